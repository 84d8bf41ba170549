#include "abbe/drivers/can/encoder_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

namespace abbe::drivers {

using protocol::HostTime;
using protocol::RawBlock;

namespace {

constexpr auto kToldAgainAfter = std::chrono::seconds{1};

}  // namespace

Result<std::unique_ptr<EncoderDevice>> EncoderDevice::create(const EncoderDeviceOptions& options,
                                                             std::unique_ptr<CanBus> bus,
                                                             const TimeSource& time) {
  if (auto ok = check(options.receiver); !ok) return tl::unexpected(ok.error());
  if (options.sync == SyncSource::Kernel && !bus->has_sync()) {
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration,
              fmt::format("CAN {}: the kernel sends a SYNC only on SocketCAN", bus->name())});
  }
  return std::unique_ptr<EncoderDevice>(new EncoderDevice(options, std::move(bus), time));
}

EncoderDevice::EncoderDevice(const EncoderDeviceOptions& options, std::unique_ptr<CanBus> bus,
                             const TimeSource& time)
    : options_(options),
      bus_(std::move(bus)),
      time_(time),
      samples_(options.sample_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(options.receiver),
      supervisor_(options.receiver.axes, options.supervisor),
      sync_under_way_(options.receiver) {
  board_.set_state("closed");
}

DeviceStatus EncoderDevice::status() const {
  return board_.read(options_.name, samples_.dropped(), raw_.dropped());
}

void EncoderDevice::wait(std::chrono::nanoseconds at_most) {
  batch_count_ = 0;
  all_read_ = true;
  turn_end_ = time_.now();
  if (!ensure_open(at_most)) return;
  follow_bus_off(turn_end_);
  send_sync();
  if (!receiver_.bus_off()) {
    supervisor_.on_time(time_.now());
    send_configuration();
  }
  if (open_) read_batch(time_.now(), at_most);
  account(turn_end_);
  show_state(turn_end_);
}

bool EncoderDevice::ensure_open(std::chrono::nanoseconds at_most) {
  if (open_) return true;
  const auto now = time_.now();
  if (now < reopen_at_) {
    std::this_thread::sleep_for(time_.wall(std::min(at_most, std::chrono::nanoseconds{reopen_at_ - now})));
    return false;
  }
  auto ids = supervisor_.ids();
  if (bus_->echoes_sync()) ids.push_back(can::cob::kSync);
  if (const auto opened = bus_->open(ids); !opened) {
    // The same refusal four times a second is one fault.
    if (opened.error().text != refusal_) board_.fault(now, opened.error().text);
    refusal_ = opened.error().text;
    reopen_at_ = now + options_.reopen_after;
    return false;
  }
  refusal_.clear();
  rival_told_ = false;
  open_ = true;
  supervisor_.start(now);
  return true;
}

void EncoderDevice::close_bus(const Error& error) {
  const auto now = time_.now();
  board_.fault(now, error.text);
  bus_->close();
  open_ = false;
  kernel_sync_ = false;
  next_sync_.reset();
  sync_under_way_.forget();
  reopen_at_ = now + options_.reopen_after;
  board_.set_connected(false);
  board_.set_state("closed");
}

void EncoderDevice::follow_bus_off(HostTime now) {
  if (receiver_.bus_off() == bus_was_off_) return;
  bus_was_off_ = receiver_.bus_off();
  next_sync_.reset();
  sync_under_way_.forget();
  if (bus_was_off_) {
    board_.fault(now, fmt::format("CAN {}: bus off", bus_->name()));
  } else {
    supervisor_.bus_recovered(now);
  }
}

bool EncoderDevice::syncing() const {
  return !receiver_.bus_off() && supervisor_.ready() > 0;
}

void EncoderDevice::follow_kernel_sync() {
  if (syncing() == kernel_sync_) return;
  if (kernel_sync_) {
    bus_->stop_sync();
  } else if (const auto started = bus_->start_sync(options_.receiver.sync_period); !started) {
    return close_bus(started.error());
  }
  kernel_sync_ = !kernel_sync_;
}

void EncoderDevice::send_sync() {
  if (options_.sync == SyncSource::Kernel) return follow_kernel_sync();
  if (!syncing()) {
    next_sync_.reset();
    return;
  }
  const auto now = time_.now();
  if (!next_sync_) next_sync_ = now;
  if (now < *next_sync_) return;
  const auto period = options_.receiver.sync_period;
  *next_sync_ +=
      period * ((now - *next_sync_) / period + 1);  // on the grid; the receiver counts what was left out
  if (sync_under_way_.waits(now)) {
    ++kept_back_;
    return;
  }
  (void)send(can::encode_sync());
}

void EncoderDevice::send_configuration() {
  while (open_) {
    const auto frame = supervisor_.take_frame();
    if (!frame || !send(*frame)) return;
  }
}

bool EncoderDevice::send(const can::CanFrame& frame) {
  const auto at = time_.now();  // before: no answer can be older than its question
  if (const auto sent = bus_->send({&frame, 1}); !sent) {
    if (sent.error().code != ErrorCode::Unreachable) {
      close_bus(sent.error());
    } else if (!unreachable_) {
      unreachable_ = true;
      board_.fault(at, sent.error().text);
    }
    return false;
  }
  if (bus_->echoes_sync() && can::decode_sync(frame)) {
    sync_under_way_.sent(at);
    return true;
  }
  record(at, RawBlock::Direction::ToDevice, {&frame, 1});
  push(receiver_.on_sent(frame, at));
  return true;
}

void EncoderDevice::read_batch(HostTime now, std::chrono::nanoseconds at_most) {
  auto until = std::min({now + at_most, receiver_.deadline(), sync_under_way_.deadline()});
  until = std::min(until, next_sync_.value_or(until));
  if (!receiver_.bus_off()) until = std::min(until, supervisor_.deadline());
  const auto budget = std::max(until - now, std::chrono::nanoseconds{0});
  const auto read = bus_->read(came_, time_.wall(budget));
  turn_end_ = time_.now();
  if (!read) {
    if (read.error().code != ErrorCode::Unreachable) return close_bus(read.error());
    if (!unreachable_) board_.fault(turn_end_, read.error().text);
    unreachable_ = true;
    return;
  }
  const auto came = std::span{came_}.first(*read);
  all_read_ = came.size() < came_.size();
  if (options_.sync == SyncSource::Thread) {
    batch_count_ = sync_under_way_.settle(came, batch_, turn_end_, all_read_);
  } else {
    std::ranges::copy(came, batch_.begin());
    batch_count_ = came.size();
  }
  for (const auto& received : std::span{batch_}.first(batch_count_)) {
    if (received.frame.is(can::FrameFlag::Error) || received.echo) continue;
    if (can::decode_sync(received.frame)) {  // no node of ours lives because of it
      if (!std::exchange(rival_told_, true))
        board_.fault(turn_end_,
                     fmt::format("CAN {}: somebody else sends SYNCs on this bus, too", bus_->name()));
      continue;
    }
    unreachable_ = false;
    last_heard_ = turn_end_;
    supervisor_.on_frame(received.frame, turn_end_);
  }
}

void EncoderDevice::account(HostTime now) {
  while (const auto text = supervisor_.take_fault()) board_.fault(now, *text);
  const auto bus = bus_->counters();
  const auto missed = receiver_.counters().missed_syncs;
  board_.gaps.add(bus.lost - bus_seen_.lost + missed - missed_seen_);
  board_.time_widened.add(bus.time_widened - bus_seen_.time_widened);
  if (bus.refused != bus_seen_.refused) {
    board_.faults.add(bus.refused - bus_seen_.refused - 1);
    board_.fault(now, fmt::format("CAN {}: read: {} datagrams that are no CAN frames", bus_->name(),
                                  bus.refused - bus_seen_.refused));
  }
  bus_seen_ = bus;
  missed_seen_ = missed;
  tell_of(kept_back_, kept_back_told_,
          "SYNCs not sent: the one before has not left, or its echo comes later than a SYNC period", now);
  tell_of(receiver_.counters().short_frames, shorts_told_, "frames too short for a position", now);
  tell_of(
      receiver_.counters().duplicate_frames, duplicates_told_,
      "second answers in a cycle: a node answers later than a SYNC period, a SYNC left late, somebody else "
      "sends SYNCs, too, the echo of a SYNC was lost, or two nodes have one number",
      now);
}

void EncoderDevice::tell_of(std::uint64_t count, Told& told, std::string_view what, HostTime now) {
  if (count == told.count || (told.at && now - *told.at < kToldAgainAfter)) return;
  board_.faults.add(count - told.count - 1);
  board_.fault(now, fmt::format("CAN {}: read: {} {}", bus_->name(), count - told.count, what));
  told = {count, now};
}

void EncoderDevice::show_state(HostTime now) {
  if (!open_) return;
  const auto ready = supervisor_.ready();
  const bool heard = last_heard_ != HostTime{} && now - last_heard_ < options_.supervisor.silence;
  board_.set_connected(heard && !receiver_.bus_off());
  board_.set_state(receiver_.bus_off()                  ? "bus off"
                   : ready == supervisor_.nodes()       ? "streaming"
                   : ready > 0                          ? "degraded"
                   : heard || last_heard_ == HostTime{} ? "configuring"
                                                        : "silent");
}

}  // namespace abbe::drivers
