#include "abbe/drivers/can/encoder_device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <thread>
#include <utility>

#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/result/try.hpp"

namespace abbe::drivers {

using protocol::HostTime;
using protocol::RawBlock;

namespace {

std::string every(const std::optional<std::chrono::nanoseconds>& period) {
  if (!period) return {};
  return fmt::format(" every {:.3f} ms",
                     std::chrono::duration<double, std::milli>(*period).count());
}

}  // namespace

Result<std::unique_ptr<EncoderDevice>> EncoderDevice::create(const EncoderDeviceOptions& options,
                                                             std::unique_ptr<CanBus> bus,
                                                             const TimeSource& time) {
  ABBE_TRY(check(options.receiver));
  if (options.sync == SyncSource::Kernel && !bus->has_sync()) {
    return tl::unexpected(
        Error{ErrorCode::BadConfiguration,
              fmt::format("CAN {}: sync = \"kernel\" needs SocketCAN", bus->name())});
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
      pending_sync_(options.receiver),
      presence_(options.receiver.axes.size(), options.receiver.sync_period),
      emergencies_(options.receiver.axes) {
  board_.set_state("closed");
}

DeviceStatus EncoderDevice::status() const {
  return board_.read(options_.name, samples_.dropped(), raw_.dropped());
}

void EncoderDevice::wait(std::chrono::nanoseconds at_most) {
  batch_count_ = 0;
  all_read_ = true;
  cycle_end_ = time_.now();
  if (!ensure_open(at_most)) return;
  follow_bus_off(cycle_end_);

  // If this thread was delayed, the frames that have arrived are read before the next SYNC is sent,
  // so that their heartbeats do not count as late.
  const bool behind = is_behind(cycle_end_);
  if (sending_ && !behind) send_sync();
  if (sending_ && !bus_off()) send_configuration();
  if (open_) read_batch(time_.now(), behind ? std::chrono::nanoseconds{0} : at_most);
  if (behind) caught_up_ = all_read_;

  if (open_) check_timeouts(cycle_end_);
  account(cycle_end_);
  show_state(cycle_end_);
}

bool EncoderDevice::is_behind(HostTime now) const {
  return !caught_up_ && next_sync_ && now >= *next_sync_ + options_.receiver.sync_period;
}

/// Checks all time-outs at `now`. Precondition: the frames that arrived before `now` were handled,
/// unless all_read_ is false.
void EncoderDevice::check_timeouts(HostTime now) {
  if (external()) return follow_external_sync(now);
  follow_foreign_sync(now);
  if (!sending_ || !all_read_ || bus_off()) return;
  if (kernel_sync_) supervisor_.on_sync(now);
  supervisor_.on_time(now);
}

void EncoderDevice::follow_foreign_sync(HostTime now) {
  if (bus_off()) return;  // no conclusion from the silence: the controller cannot receive a SYNC
  if (!all_read_ && !sending_) return;  // unread frames may contain a SYNC
  const bool may_send = foreign_.may_send(now);

  if (may_send && !sending_) {
    foreign_reported_ = false;
    sending_ = true;
    supervisor_.start(now);
  } else if (!may_send && sending_) {
    stop_sending();
  }

  const bool measured = foreign_.period() || now - foreign_.last() >= ForeignSync::kListenFor;
  if (!foreign_.present() || !measured || std::exchange(foreign_reported_, true)) return;
  board_.fault(
      now, fmt::format(
               "CAN {}: another SYNC producer is on this bus{}: nothing is sent. To use its SYNC "
               "set sync = \"external\"; otherwise switch that producer off",
               bus_->name(), every(foreign_.period())));
}

void EncoderDevice::follow_external_sync(HostTime now) {
  const auto period = options_.receiver.sync_period;
  const auto patience = std::max(ForeignSync::kListenFor, 3 * period);
  const bool missing = now - std::max(opened_at_, foreign_.last()) >= patience;

  if (missing && all_read_ && !std::exchange(no_sync_reported_, true))
    board_.fault(
        now,
        fmt::format(
            "CAN {}: no SYNC (080h) for {} ms: sync = \"external\" needs the SYNC of the machine",
            bus_->name(), patience / std::chrono::milliseconds{1}));
  if (!missing) no_sync_reported_ = false;
  const auto measured = foreign_.period();
  if (!measured || now - opened_at_ < ForeignSync::kListenFor) return;
  const bool differs = *measured < period * 9 / 10 || *measured > period * 11 / 10;
  if (differs && !period_reported_)
    board_.fault(
        now, fmt::format("CAN {}: the machine's SYNC comes{}, configured is sync_period_us = {}",
                         bus_->name(), every(measured), period / std::chrono::microseconds{1}));
  period_reported_ = differs;
}

void EncoderDevice::stop_sending() {
  sending_ = false;
  supervisor_.stop();
  if (kernel_sync_) bus_->stop_sync();
  kernel_sync_ = false;
  next_sync_.reset();
  pending_sync_.forget();
}

bool EncoderDevice::ensure_open(std::chrono::nanoseconds at_most) {
  if (open_) return true;
  const auto now = time_.now();
  if (now < reopen_at_) {
    std::this_thread::sleep_for(
        time_.wall(std::min(at_most, std::chrono::nanoseconds{reopen_at_ - now})));
    return false;
  }

  auto ids = supervisor_.ids();
  ids.push_back(can::cob::kSync);
  if (const auto opened = bus_->open(ids); !opened) {
    // Repeated attempts with the same refusal (four a second) are reported once.
    if (opened.error().text != refusal_) board_.fault(now, opened.error().text);
    refusal_ = opened.error().text;
    reopen_at_ = now + options_.reopen_after;
    return false;
  }

  refusal_.clear();
  open_ = true;
  opened_at_ = now;
  reopened_ = receiver_.bus_off();
  bus_was_off_ = false;
  foreign_.opened(now);

  return true;
}

void EncoderDevice::close_bus(const Error& error) {
  const auto now = time_.now();
  board_.fault(now, error.text);
  bus_->close();
  open_ = false;
  stop_sending();
  presence_.forget();
  show_condition(now);
  reopen_at_ = now + options_.reopen_after;
  board_.set_connected(false);
  board_.set_state("closed");
}

void EncoderDevice::follow_bus_off(HostTime now) {
  if (!receiver_.bus_off()) reopened_ = false;
  if (bus_off() == bus_was_off_) return;
  bus_was_off_ = bus_off();
  next_sync_.reset();
  pending_sync_.forget();

  if (bus_was_off_) {
    off_since_ = now;
    board_.fault(now, fmt::format("CAN {}: bus off", bus_->name()));
  } else if (sending_ && now - off_since_ <= ForeignSync::kShortBreak) {
    supervisor_.bus_recovered(now);
  } else if (!external()) {  // another producer may have appeared meanwhile, so the device listens
                             // again
    stop_sending();
    foreign_.opened(now);
  }
}

bool EncoderDevice::syncing() const {
  return !bus_off() && supervisor_.ready() > 0;
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
  const auto late = now - *next_sync_;
  *next_sync_ += period * (late / period + 1);  // the receiver counts skipped periods
  if (late >= period) return;  // the next SYNC could follow before the answers have arrived

  if (pending_sync_.waits(now)) {
    ++withheld_syncs_;
    return;
  }

  caught_up_ = false;
  if (send(can::encode_sync())) supervisor_.on_sync(now);
}

void EncoderDevice::send_configuration() {
  while (open_) {
    const auto frame = supervisor_.take_frame();
    if (!frame || !send(*frame)) return;
  }
}

bool EncoderDevice::send(const can::CanFrame& frame) {
  const auto at = time_.now();  // read before send(), because no answer can be earlier than this
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
    pending_sync_.sent(at);
    return true;
  }

  record(at, RawBlock::Direction::ToDevice, {&frame, 1});
  push(receiver_.on_sent(frame, at));
  return true;
}

void EncoderDevice::read_batch(HostTime now, std::chrono::nanoseconds at_most) {
  auto until = std::min({now + at_most, receiver_.deadline(), pending_sync_.deadline()});
  if (!external()) until = std::min(until, foreign_.deadline());
  until = std::min(until, next_sync_.value_or(until));
  if (sending_ && !bus_off()) until = std::min(until, supervisor_.deadline());
  const auto budget = std::max(until - now, std::chrono::nanoseconds{0});
  const auto read = bus_->read(came_, time_.wall(budget));
  cycle_end_ = read ? read->until : time_.now();

  if (!read) {
    if (read.error().code != ErrorCode::Unreachable) return close_bus(read.error());
    if (!unreachable_) board_.fault(cycle_end_, read.error().text);
    unreachable_ = true;
    return;
  }

  const auto came = std::span{came_}.first(read->frames);
  all_read_ = read->all;
  if (options_.sync == SyncSource::Thread) {
    batch_count_ = pending_sync_.settle(came, batch_, cycle_end_, all_read_);
  } else {
    std::ranges::copy(came, batch_.begin());
    batch_count_ = came.size();
  }

  for (const auto& received : std::span{batch_}.first(batch_count_)) dispatch(received);
}

/// Handles a frame outside the RT path. receive() later passes the same frame to the receiver.
void EncoderDevice::dispatch(const ReceivedFrame& received) {
  if (const auto report = can::decode_error_frame(received.frame)) {
    if (has(report->conditions, can::BusCondition::BusOff)) reopened_ = false;
    return;
  }
  if (received.echo) return;
  if (can::decode_sync(received.frame))
    return foreign_.heard(received.time);  // a SYNC does not show that a node is alive
  unreachable_ = false;
  last_heard_ = cycle_end_;
  together_.on_frame(received);
  emergencies_.on_frame(received.frame, cycle_end_);
  if (sending_) supervisor_.on_frame(received.frame, cycle_end_);
}

}  // namespace abbe::drivers
