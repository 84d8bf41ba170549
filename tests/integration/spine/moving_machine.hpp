#pragma once
/// A measuring machine that moves slowly at the command of abbed: what happens to it is seen.

#include <gtest/gtest.h>
#include <poll.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "spine.hpp"

namespace abbe::test {

/// The simulated machine on its port, in real time, in a thread of its own. It continues its
/// motion when the connection closes.
class MachineInAThread {
 public:
  explicit MachineInAThread(const sim::IppDmeOptions& options)
      : server_(
            sim::IppDmeServer::open(0, std::make_unique<sim::IppDmeDevice>(options, clock_.now()))
                .value()),
        thread_([this] { run(); }) {}
  MachineInAThread(const MachineInAThread&) = delete;
  MachineInAThread& operator=(const MachineInAThread&) = delete;
  ~MachineInAThread() {
    stop_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  [[nodiscard]] bool moving() {
    const std::lock_guard lock{mutex_};
    return server_.device().moving();
  }
  [[nodiscard]] std::vector<std::string> heard() {
    const std::lock_guard lock{mutex_};
    const auto& all = server_.device().heard();
    return {all.begin(), all.end()};
  }
  [[nodiscard]] Eigen::Vector3d reading_m() {
    const std::lock_guard lock{mutex_};
    return server_.device().reading_m(clock_.now());
  }

 private:
  void run() {
    while (!stop_) {
      pollfd fds[2] = {{server_.listener_fd(), POLLIN, 0}, {server_.client_fd(), POLLIN, 0}};
      ::poll(fds, 2, 1);
      const std::lock_guard lock{mutex_};
      server_.poll(clock_.now());
    }
  }

  sim::SimClock clock_{1.0};
  sim::IppDmeServer server_;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class MovingMachine : public Spine {
 protected:
  using json = nlohmann::json;

  /// Slow: each of its motions takes a minute.
  static sim::IppDmeOptions slow_machine() {
    sim::IppDmeOptions machine;
    machine.machine.spheres = {{.centre_m = {0.05, 0.05, -0.15}, .radius_m = 12.5e-3}};
    machine.travel_speed_m_s = 3e-3;
    machine.home_time = std::chrono::minutes{1};
    return machine;
  }
  void start_at(MachineInAThread& machine, const std::string& more = {}) {
    write_configuration_of("[cmm]\nhost = \"127.0.0.1\"\nport = " + std::to_string(machine.port()) +
                           "\n" + more);
    write("abbed.toml", replaced(text_of(file("abbed.toml")), "\nspeed = [0-9]+", "\nspeed = 1"));
    ASSERT_NO_FATAL_FAILURE(start_abbed());
  }
  [[nodiscard]] auto ask(const json& request) const {
    return daemon::ask_daemon(directory_ / "run" / "control.sock", request);
  }
  /// abbed has sent a touch, and the machine is on its way: for a minute.
  void begin_touch(MachineInAThread& machine) const {
    ASSERT_TRUE(eventually([&] { return ask(touch_request()).has_value(); })) << status().dump(1);
    ASSERT_TRUE(eventually(
        [&] { return machine.moving() && machine.heard().back().starts_with("PtMeas"); }));
  }
  /// Starts abbed, and then a touch.
  void start_touching(MachineInAThread& machine) {
    ASSERT_NO_FATAL_FAILURE(start_at(machine));
    ASSERT_NO_FATAL_FAILURE(begin_touch(machine));
  }
  /// The top of the sphere.
  static json touch_request() {
    return {
        {"do", "touch"},
        {"points",
         {{{"way", json::array()}, {"at_m", {0.05, 0.05, -0.1355}}, {"normal", {0.0, 0.0, 1.0}}}}}};
  }
};

}  // namespace abbe::test
