// The real-time part of the counter card: converts the events of wait() to scans and samples.
#include <algorithm>
#include <utility>

#include "abbe/drivers/counter_card/device.hpp"

namespace abbe::drivers {

using protocol::RawBlock;
using protocol::usbip::SubmitReply;

void CounterCardDevice::receive() ABBE_RT {
  for (const auto& event : events_) {
    if (const auto* bulk = std::get_if<UsbBulkIn>(&event)) take(*bulk);
    if (const auto* done = std::get_if<UsbControlDone>(&event)) take(*done);
  }
  const auto gaps = receiver_.counters().gaps;
  board_.gaps.add(gaps - std::exchange(gaps_seen_, gaps));
}

void CounterCardDevice::take(const UsbBulkIn& bulk) ABBE_RT {
  SubmitReply reply;
  reply.head.direction = protocol::usbip::Direction::In;
  reply.head.endpoint = quad08::kScanEndpoint & 0x0Fu;
  if (bulk.outcome != UsbOutcome::Done) reply.status = protocol::usbip::UrbStatus::Stalled;
  record(reply, bulk.bytes, bulk.arrival);
  receiver_.push(bulk.bytes, bulk.arrival);
  for (auto scans = receiver_.next(); !scans.empty(); scans = receiver_.next()) {
    for (const auto& scan : scans) push(scan);
    scans_ += scans.size();
    board_.set_last_sample(scans.back().axes.head.time);
    board_.set_clock(receiver_.clock());
    note_progress(scans.back());
  }
  const auto withheld = receiver_.counters().withheld_scans;
  scans_ += withheld - std::exchange(withheld_seen_, withheld);
}

void CounterCardDevice::note_progress(const CounterScan& scan) ABBE_RT {
  constexpr std::chrono::seconds kPeriod{1};
  const bool settled = !has(scan.axes.head.flags, protocol::SampleFlag::ClockUnsettled);
  const auto since = scan.axes.head.time - progress_.head.time;
  if (!settled || (since < kPeriod && since >= std::chrono::nanoseconds{0})) return;
  progress_.head = scan.axes.head;
  progress_.clock_count = scan.clock_count;
  progress_.axis_count = scan.axes.axis_count;
  progress_.count = scan.axes.count;
  progress_ring_.try_push(progress_);
}

void CounterCardDevice::take(const UsbControlDone& done) ABBE_RT {
  SubmitReply reply;
  reply.head.direction = done.setup.device_to_host() ? protocol::usbip::Direction::In
                                                     : protocol::usbip::Direction::Out;
  if (done.outcome != UsbOutcome::Done) reply.status = protocol::usbip::UrbStatus::Stalled;
  record(reply, done.bytes(), cycle_end_);
}

void CounterCardDevice::record(const SubmitReply& reply, std::span<const std::byte> data,
                               protocol::HostTime time) ABBE_RT {
  const std::size_t length = std::min(data.size(), CounterCardReceiver::kLongestTransfer);
  SubmitReply numbered = reply;
  numbered.head.sequence = ++raw_sequence_;
  numbered.length = static_cast<std::uint32_t>(length);
  const auto header = protocol::usbip::encode(protocol::usbip::Urb{numbered});
  const auto body = std::copy(header.begin(), header.end(), message_.begin());
  std::copy_n(data.begin(), length, body);
  raw_.push_bytes(time, RawBlock::Direction::FromDevice,
                  std::span{message_}.first(header.size() + length));
}

void CounterCardDevice::push(const CounterScan& scan) ABBE_RT {
  if (sink_ != nullptr) sink_->on_scan(scan);
  if (!live_axes_) return;
  const auto sample = decimation_.take(scan.axes);
  if (!sample) return;
  samples_.try_push(*sample);
  board_.samples.add();
}

}  // namespace abbe::drivers
