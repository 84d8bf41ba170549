// The real-time part of the measuring machine: converts the bytes that wait() read to samples.
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/protocol/visit.hpp"

namespace abbe::drivers {

void IppDevice::receive() ABBE_RT {
  const auto bytes = received();
  if (bytes.empty()) return;
  raw_.push_bytes(arrival_, protocol::RawBlock::Direction::FromDevice, bytes);
  receiver_.push(bytes, arrival_);
  while (const auto message = receiver_.next()) {
    protocol::visit_trivial([this](const auto& m) ABBE_RT { take(m); }, *message);
  }
}

void IppDevice::take(const protocol::AxisSample& sample) ABBE_RT {
  positions_.try_push(sample);
  board_.samples.add();
  board_.set_last_sample(sample.head.time);
}

void IppDevice::take(const protocol::ProbeTrigger& touch) ABBE_RT {
  touches_.try_push(touch);
  board_.samples.add();
  board_.set_last_sample(touch.head.time);
}

}  // namespace abbe::drivers
