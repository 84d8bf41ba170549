#pragma once
/// The simulator's encoder bus with a thread of its own: nodes 1 to n, measuring the axes of a
/// machine that moves along X, Y and Z at once at constant speed.

#include <poll.h>
#include <pthread.h>

#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "can_interface.hpp"

namespace abbe::tests {

inline constexpr double kFeed_m_per_s = 0.1;

inline std::string sync_name(const testing::TestParamInfo<drivers::SyncSource>& instance) {
  return instance.param == drivers::SyncSource::Thread ? "ByTheThread" : "ByTheKernel";
}

class SimulatedEncoders {
 public:
  /// `priority`: SCHED_FIFO, for nodes that must not compete with what is measured; 0: ordinary.
  SimulatedEncoders(const CanInterface& interface, std::size_t axes, int priority = 0)
      : SimulatedEncoders(on(interface), axes, priority) {}
  SimulatedEncoders(const sim::CanPortOptions& options, std::size_t axes, int priority)
      : machine_(sim::TruthMachine{}, sim::PathMotion::plan(path()).value()) {
    const auto now = clock_.now();
    machine_.start(now);
    std::vector<sim::EncoderNodeOptions> nodes;

    for (std::size_t i = 0; i < axes; ++i) {
      nodes.push_back({.node = static_cast<can::NodeId>(i + 1),
                       .axis = sim::kAxes[i % sim::kAxes.size()],
                       .noise = 0.0,
                       .boot_time = std::chrono::milliseconds{20}});
    }

    auto bus = sim::EncoderBus::open(options, nodes, machine_, now);
    EXPECT_TRUE(bus.has_value()) << bus.error().text;
    bus_.emplace(std::move(*bus));

    thread_ = std::thread([this, priority] {
      const sched_param param{.sched_priority = priority};
      if (priority != 0) {
        EXPECT_EQ(pthread_setschedparam(pthread_self(), SCHED_FIFO, &param), 0);
      }
      serve();
    });
  }
  ~SimulatedEncoders() {
    stop_ = true;
    thread_.join();
  }
  SimulatedEncoders(const SimulatedEncoders&) = delete;
  SimulatedEncoders& operator=(const SimulatedEncoders&) = delete;

  [[nodiscard]] std::uint16_t port() const { return bus_->port(); }
  void inject(const sim::Fault& fault) {
    const std::lock_guard lock(mutex_);
    faults_.push_back(fault);
  }
  /// What the scales read at `at`, m.
  [[nodiscard]] double reading_m(std::size_t axis, protocol::HostTime at) const {
    return machine_.motion(at).q_m[static_cast<Eigen::Index>(axis % sim::kAxes.size())];
  }

  static std::vector<drivers::EncoderAxis> axes(std::size_t n) {
    std::vector<drivers::EncoderAxis> out;
    for (std::size_t i = 0; i < n; ++i) {
      out.push_back({.name = std::string(1, "XYZAC"[i]), .node = static_cast<can::NodeId>(i + 1)});
    }
    return out;
  }

 private:
  static sim::CanPortOptions on(const CanInterface& interface) {
    sim::CanPortOptions options;
    options.interface = interface.name();
    options.speed = 1.0;
    return options;
  }
  static sim::PathPlan path() {
    sim::PathPlan plan;
    const double far = 100.0;  // m: a constant speed for longer than any test
    plan.vertices = {{.q_m = Eigen::Vector3d::Zero()}, {.q_m = Eigen::Vector3d::Constant(far)}};
    plan.feed_m_per_s = kFeed_m_per_s * std::sqrt(3.0);
    plan.acceleration_m_per_s2 = 10.0;
    return plan;
  }
  void serve() {
    // so soon faults are heard
    constexpr std::chrono::nanoseconds kLongest = std::chrono::milliseconds{5};
    while (!stop_) {
      const auto wait =
          std::clamp(bus_->next_due() - clock_.now(), std::chrono::nanoseconds{0}, kLongest);
      const timespec timeout{0, static_cast<long>(wait.count())};
      pollfd ready{bus_->fd(), POLLIN, 0};
      ::ppoll(&ready, 1, &timeout, nullptr);
      const auto now = clock_.now();
      for (const auto& fault : take_faults()) bus_->inject(fault, now);
      bus_->poll(now);
    }
  }
  std::vector<sim::Fault> take_faults() {
    const std::lock_guard lock(mutex_);
    return std::exchange(faults_, {});
  }

  sim::SimClock clock_{1.0};
  sim::VirtualMachine machine_;
  std::optional<sim::EncoderBus> bus_;
  std::mutex mutex_;
  std::vector<sim::Fault> faults_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace abbe::tests
