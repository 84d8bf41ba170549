#include "abbe/drivers/tracker/device.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <utility>

namespace abbe::drivers {

TrackerReceiverOptions receiver_options(const TrackerDeviceOptions& options) {
  TrackerReceiverOptions receiver;
  receiver.clock = options.clock;
  const bool periodic = options.session.mode == TrackerMode::ContinuousTime;
  receiver.time_separation =
      std::chrono::milliseconds{periodic ? options.session.time_separation_ms : 0};
  receiver.stationary_time = std::chrono::milliseconds{options.session.stationary_time_ms};
  receiver.air_measured = options.session.weather != emscon::WeatherMonitor::None;
  return receiver;
}

Result<std::unique_ptr<TrackerDevice>> TrackerDevice::create(const TrackerDeviceOptions& options,
                                                             const TimeSource& time) {
  const TcpPeer peer = tcp_peer(options.name, options.host, options.port);
  TrackerDeviceOptions named = options;
  named.session.peer = peer.name;
  if (const auto valid = check(named.session); !valid) return tl::unexpected{valid.error()};
  if (const auto valid = check(peer); !valid) return tl::unexpected{valid.error()};
  return std::unique_ptr<TrackerDevice>{new TrackerDevice{named, peer, time}};
}

TrackerDevice::TrackerDevice(const TrackerDeviceOptions& options, TcpPeer peer,
                             const TimeSource& time)
    : SessionOverTcp(std::move(peer), time, TrackerSession{options.session}),
      options_(options),
      points_(options.point_capacity),
      environment_(options.environment_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(receiver_options(options)) {
  show();
}

TrackerDevice::~TrackerDevice() {
  try {
    restore_settings();
    leave(TrackerStopRequested{});
  } catch (...) {  // NOLINT(bugprone-empty-catch)
    // Out of memory: the connection closes, which stops the controller, too.
  }
}

void TrackerDevice::wait(std::chrono::nanoseconds at_most) {
  handle_posted_messages();
  handle_orders();
  if (!reads_before_due()) {
    handle(TrackerTick{});
    poll(at_most);
  }
  report_clock();
  report_times();
  report_cause();
  show();
}

/// Stops the session within leave_within, measured by the steady clock: the stepped host time of a
/// test does not advance here, so the session's own time-outs would never end the loop.
void TrackerDevice::restore_settings() {
  constexpr auto kLook = std::chrono::milliseconds{20};
  const auto until = std::chrono::steady_clock::now() + time_.wall(options_.session.leave_within);
  while (!finish() && std::chrono::steady_clock::now() < until) {
    wait(time_.host(kLook));
    receive();
  }
}

void TrackerDevice::handle_orders() {
  // keeps the report of an order that has just ended, because the session stores only one
  keep_report();
  for (TrackerOrder& order : orders_.take()) {
    handle(std::move(order));
    keep_report();
  }
  keep_report();
}

void TrackerDevice::keep_report() {
  if (auto report = session().take_report()) reports_.put(std::move(*report));
}

void TrackerDevice::report_clock() {
  const double skew = receiver_.skew_beyond_limit();
  if (std::exchange(clock_reported_, skew != 0.0) || skew == 0.0) return;
  constexpr double kPpm = 1e6;
  board_.fault(
      time_.now(),
      fmt::format("{}: the tracker's clock runs {:.0f} ppm {}, a sound one at most {:.0f} ppm: its "
                  "points are marked ClockUnsettled; {}",
                  peer_.name, kPpm * std::abs(skew), skew > 0.0 ? "fast" : "slow",
                  kPpm * options_.clock.max_skew, options_.clock_advice));
}

/// Reports points whose time did not fit, and jumps of the tracker's clock.
void TrackerDevice::report_times() {
  const auto& counters = receiver_.counters();
  const auto refused =
      counters.time_disorder - std::exchange(times_refused_seen_, counters.time_disorder);
  const auto jumps = counters.time_jumps - std::exchange(time_jumps_seen_, counters.time_jumps);
  if (jumps > 0) {
    board_.fault(time_.now(),
                 fmt::format("{}: the tracker's clock jumped: the points before and after the jump "
                             "are not used together; do not set its clock during a run",
                             peer_.name));
  } else if (refused > 0) {
    board_.fault(time_.now(), fmt::format("{}: the times of {} points do not fit those of the "
                                          "others: these points are not used",
                                          peer_.name, refused));
  }
}

/// Reports the reason why there are no points, if it is not a fault. Faults are reported by show().
void TrackerDevice::report_cause() {
  const std::string& cause = session().cause();
  if (cause == cause_reported_) return;
  cause_reported_ = cause;
  const bool fault = session().fault().text.ends_with(cause);
  if (!cause.empty() && !fault) board_.note(time_.now(), peer_.name + ": " + cause);
}

bool TrackerDevice::finish() {
  handle(TrackerStopRequested{});
  show();
  return session().has_left();
}

DeviceStatus TrackerDevice::status() const {
  return board_.read(options_.name, points_.dropped(), raw_.dropped());
}

std::span<const std::byte> TrackerDevice::encode(const TrackerSend& command) {
  const auto packet =
      std::span<const std::byte>{command_}.first(emscon::encode(command.request, command_));
  raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, packet);
  return packet;
}

}  // namespace abbe::drivers
