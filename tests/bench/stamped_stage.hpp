#pragma once
/// Simulated encoders (CANopen) and tracker at real speed. They record when the last TPDO of a
/// cycle and the last byte of a burst of tracker points were sent. Both are sent at the rate of
/// their transport: three TPDOs one after the other at 1 Mbit/s, a burst in Ethernet segments at
/// 100 Mbit/s. The bytes are prepared before; the time is read just before and just after the
/// system call that sends the last byte, so that the duration of this call is part of the measured
/// delay.

#include <poll.h>

#include <algorithm>
#include <array>
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
    // the machine stands still: no message depends on its position
    auto path = sim::PathMotion::plan({.vertices = {{}}});
    if (!path) return tl::unexpected(path.error());
    std::unique_ptr<StampedStage> stage(new StampedStage(std::move(*path)));
    const auto now = stage->clock_.now();
    auto tracker = sim::TrackerServer::open(
        0, std::make_unique<sim::TrackerDevice>(
               sim::TrackerOptions{.initialize_time = std::chrono::milliseconds{100}},
               stage->machine_, now));
    if (!tracker) return tl::unexpected(tracker.error());
    stage->tracker_ = std::make_unique<sim::TrackerServer>(std::move(*tracker));
    const std::array<sim::EncoderNodeOptions, kNodes> nodes{{{.node = 1, .axis = sim::Axis::X},
                                                             {.node = 2, .axis = sim::Axis::Y},
                                                             {.node = 3, .axis = sim::Axis::Z}}};

    // With the default of .speed a SYNC gets the time at which it is read, and each node replies
    // after the delay that delay_until() sets below.
    auto bus = sim::EncoderBus::open({}, nodes, stage->machine_, now);
    if (!bus) return tl::unexpected(bus.error());
    stage->bus_ = std::make_unique<sim::EncoderBus>(std::move(*bus));
    std::chrono::nanoseconds on_the_bus = kSyncOnTheBus;
    for (auto& node : stage->bus_->nodes())
      node.delay_until(sim::HostTime::max(), on_the_bus += kTpdoOnTheBus);
    stage->tracker_->send_per_poll(kSegmentBytes);

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

  /// Waits for the next event and handles it.
  void cycle() {
    std::vector<pollfd> fds{{bus_->fd(), POLLIN, 0}, {tracker_->listener_fd(), POLLIN, 0}};
    if (tracker_->client_fd() >= 0) fds.push_back({tracker_->client_fd(), POLLIN, 0});
    const auto tracker_due = tracker_->wants_write() ? segment_due_ : tracker_->next_due();
    const auto due = std::min(tracker_due, bus_->next_due());
    const auto wait =
        std::clamp<std::chrono::nanoseconds>(due - clock_.now(), {}, std::chrono::milliseconds{50});
    const timespec timeout{0, wait.count()};
    ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    cycle_bus((fds[0].revents & POLLIN) != 0);
    cycle_tracker();
  }

 private:
  explicit StampedStage(sim::PathMotion path) : machine_({}, std::move(path)) {}

  static constexpr std::size_t kNodes = 3;
  // Duration of frames at 1 Mbit/s: a frame without data takes 44 bits, a frame with a position of
  // 4 bytes 76 bits; added are 3 bits between frames and stuff bits, at most 8 and 16.
  static constexpr std::chrono::microseconds kSyncOnTheBus{55};
  static constexpr std::chrono::microseconds kTpdoOnTheBus{95};
  // At 100 Mbit/s a full Ethernet segment takes, with its headers, the time of 1538 bytes.
  static constexpr std::size_t kSegmentBytes = 1448;
  static constexpr std::chrono::microseconds kSegmentOnTheWire{123};

  /// Records the time of the poll() that sends the last reply to a SYNC. That a SYNC was received
  /// is seen from a reply that is due at the time of a first TPDO. Node 1's reply to its
  /// configuration is due at such a time, too, and is recorded as a cycle; so call forget() before
  /// measuring.
  void cycle_bus(bool asked) {
    const auto now = clock_.now();
    const std::int64_t before_ns = monotonic_ns();
    bus_->poll(now);
    if (last_answer_due_ && now >= *last_answer_due_) {
      last_answer_due_.reset();
      cycles_.push_back({before_ns, monotonic_ns()});
    }
    if (asked && !last_answer_due_ && bus_->next_due() == now + kSyncOnTheBus + kTpdoOnTheBus)
      last_answer_due_ = now + kSyncOnTheBus + kNodes * kTpdoOnTheBus;
  }

  /// Records the time of the poll() after which no byte of a burst is left to send. The points are
  /// made before the time is read, so that only the sending is measured.
  void cycle_tracker() {
    const auto now = clock_.now();
    if (tracker_->wants_write() && now < segment_due_) return;
    const auto sent = tracker_->device().points_sent();
    tracker_->device().advance(now);
    in_burst_ = in_burst_ || tracker_->device().points_sent() != sent;
    const std::int64_t before_ns = monotonic_ns();
    tracker_->poll(now);
    segment_due_ = now + kSegmentOnTheWire;
    if (tracker_->wants_write() || !in_burst_) return;
    in_burst_ = false;
    bursts_.push_back({before_ns, monotonic_ns()});
  }

  sim::SimClock clock_{1.0};
  sim::VirtualMachine machine_;
  std::unique_ptr<sim::TrackerServer> tracker_;
  std::unique_ptr<sim::EncoderBus> bus_;
  std::optional<sim::HostTime> last_answer_due_;  ///< to the latest SYNC
  sim::HostTime segment_due_{};
  bool in_burst_ = false;
  std::vector<Departure> cycles_, bursts_;
};

}  // namespace abbe::bench
