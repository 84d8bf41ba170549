#pragma once
/// The simulated devices at real speed, which note when the last TPDO of a cycle and the last byte of a burst
/// left. What leaves is made before; the stamps are taken just before and after it is sent, so that the
/// system call itself counts against abbe.

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "abbe/sim/encoder_bus.hpp"
#include "abbe/sim/tracker_server.hpp"
#include "snapshot_log.hpp"

namespace abbe::bench {

struct Departure {
  std::int64_t before_ns = 0;  ///< CLOCK_MONOTONIC
  std::int64_t after_ns = 0;
};

class StampedStage {
 public:
  [[nodiscard]] static sim::Result<std::unique_ptr<StampedStage>> open() {
    auto path = sim::PathMotion::plan({.vertices = {{}}});  // the machine stands: nothing here depends on it
    if (!path) return tl::unexpected(path.error());
    std::unique_ptr<StampedStage> stage(new StampedStage(std::move(*path)));
    const auto now = stage->clock_.now();
    auto tracker = sim::TrackerServer::open(
        0, std::make_unique<sim::TrackerDevice>(
               sim::TrackerOptions{.initialize_time = std::chrono::milliseconds{100}}, stage->machine_, now));
    if (!tracker) return tl::unexpected(tracker.error());
    stage->tracker_ = std::make_unique<sim::TrackerServer>(std::move(*tracker));
    const std::vector<sim::EncoderNodeOptions> nodes{{.node = 1, .axis = sim::Axis::X},
                                                     {.node = 2, .axis = sim::Axis::Y},
                                                     {.node = 3, .axis = sim::Axis::Z}};
    auto bus = sim::EncoderBus::open({.speed = 1.0}, nodes, stage->machine_, now);
    if (!bus) return tl::unexpected(bus.error());
    stage->bus_ = std::make_unique<sim::EncoderBus>(std::move(*bus));
    for (auto& node : stage->bus_->nodes()) node.delay_until(sim::HostTime::max(), kOnTheBus);
    return stage;
  }

  [[nodiscard]] std::uint16_t tracker_port() const { return tracker_->port(); }
  [[nodiscard]] std::uint16_t can_port() const { return bus_->port(); }
  [[nodiscard]] const std::vector<Departure>& cycles() const { return cycles_; }
  [[nodiscard]] const std::vector<Departure>& bursts() const { return bursts_; }
  void forget() {
    cycles_.clear();
    bursts_.clear();
  }

  /// Waits until something is to do, and does it.
  void turn() {
    std::vector<pollfd> fds{{bus_->fd(), POLLIN, 0}, {tracker_->listener_fd(), POLLIN, 0}};
    const short events = static_cast<short>(tracker_->wants_write() ? POLLIN | POLLOUT : POLLIN);
    if (tracker_->client_fd() >= 0) fds.push_back({tracker_->client_fd(), events, 0});
    const auto due = std::min(tracker_->next_due(), answers_due_.value_or(bus_->next_due()));
    const auto wait =
        std::clamp<std::chrono::nanoseconds>(due - clock_.now(), {}, std::chrono::milliseconds{50});
    const timespec timeout{0, wait.count()};
    ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    turn_bus((fds[0].revents & POLLIN) != 0);
    turn_tracker();
  }

 private:
  explicit StampedStage(sim::PathMotion path) : machine_({}, std::move(path)) {}

  /// What three TPDOs and their SYNC take at 1 Mbit/s: how long after the SYNC the last one ends.
  static constexpr std::chrono::microseconds kOnTheBus{400};

  template <class Send>
  static void stamp(std::vector<Departure>& departures, Send&& send) {
    const std::int64_t before_ns = monotonic_ns();
    send();
    departures.push_back({before_ns, monotonic_ns()});
  }

  /// From a SYNC until its answers are due nothing else leaves: what is stamped holds the last TPDO.
  void turn_bus(bool asked) {
    const auto now = clock_.now();
    if (asked) {
      bus_->poll(now);
      answers_due_ = now + kOnTheBus;
    } else if (!answers_due_) {
      bus_->poll(now);
    } else if (now >= *answers_due_) {
      answers_due_.reset();
      stamp(cycles_, [&] { bus_->poll(now); });
    }
  }

  /// The points are made first: what leaves afterwards is only the sending.
  void turn_tracker() {
    const auto now = clock_.now();
    const auto sent = tracker_->device().points_sent();
    tracker_->device().advance(now);
    if (tracker_->device().points_sent() == sent) return tracker_->poll(now);
    stamp(bursts_, [&] { tracker_->poll(now); });
  }

  sim::SimClock clock_{1.0};
  sim::VirtualMachine machine_;
  std::unique_ptr<sim::TrackerServer> tracker_;
  std::unique_ptr<sim::EncoderBus> bus_;
  std::optional<sim::HostTime> answers_due_;  ///< to the SYNC that came last
  std::vector<Departure> cycles_, bursts_;
};

}  // namespace abbe::bench
