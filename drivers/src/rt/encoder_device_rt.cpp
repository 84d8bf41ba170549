// The real-time part of the encoder device: converts the frames that wait() read to samples. The
// rest is in can/encoder_device.cpp.

#include "abbe/drivers/can/encoder_device.hpp"

namespace abbe::drivers {

using protocol::HostTime;
using protocol::RawBlock;

void EncoderDevice::receive() ABBE_RT {
  const auto frames = std::span<const ReceivedFrame>{batch_}.first(batch_count_);
  record_frames(frames);
  for (const auto& received : frames) {
    push(received.echo ? receiver_.on_sent(received.frame, received.time, received.time_widened)
                       : receiver_.on_frame(received.frame, received.time, received.time_widened));
  }
  batch_count_ = 0;
  // on_time() requires that all frames that arrived before cycle_end_ were read.
  if (!all_read_ || cycle_end_ < receiver_.deadline()) return;
  (void)raw_.push_bytes(cycle_end_, RawBlock::Direction::FromDevice, {});
  push(receiver_.on_time(cycle_end_));
}

/// Writes one block for every run of frames with the same time and direction.
void EncoderDevice::record_frames(std::span<const ReceivedFrame> frames) ABBE_RT {
  std::size_t i = 0;
  while (i < frames.size()) {
    can::DatagramWriter writer{datagram_, raw_sequence_++};
    const auto& first = frames[i];
    const auto belongs = [&](const ReceivedFrame& f) {
      return f.time == first.time && f.echo == first.echo;
    };
    while (i < frames.size() && belongs(frames[i]) && writer.add(frames[i].frame)) ++i;
    (void)raw_.push_bytes(
        first.time, first.echo ? RawBlock::Direction::ToDevice : RawBlock::Direction::FromDevice,
        writer.finish());
  }
}

void EncoderDevice::record(HostTime time, RawBlock::Direction direction,
                           std::span<const can::CanFrame> frames) ABBE_RT {
  can::DatagramWriter writer{datagram_, raw_sequence_++};
  for (const auto& frame : frames) (void)writer.add(frame);
  (void)raw_.push_bytes(time, direction, writer.finish());
}

void EncoderDevice::push(std::span<const protocol::AxisSample> samples) ABBE_RT {
  for (const auto& sample : samples) {
    (void)samples_.try_push(sample);
    presence_.on_sample(sample);
    board_.set_last_sample(sample.head.time);
  }
  board_.samples.add(samples.size());
}

}  // namespace abbe::drivers
