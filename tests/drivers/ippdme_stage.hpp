#pragma once
/// A driver of a measuring machine, the simulated machine's server and their common time, for
/// tests.

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/ippdme/device.hpp"
#include "ippdme_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {

inline sim::IppDmeOptions machine_with_a_sphere() {
  sim::IppDmeOptions o;
  o.machine.spheres = {{.centre_m = {0.1, 0.2, -0.1}, .radius_m = 12.5e-3}};
  return o;
}

/// A driver, its server and their common time.
struct IppStage {
  explicit IppStage(const sim::IppDmeOptions& machine = machine_with_a_sphere(),
                    drivers::IppDeviceOptions options = {})
      : peer(time.now(), machine) {
    options.port = peer.port();
    device = drivers::IppDevice::create(options, time).value();
  }
  void cycle() {
    peer.serve(time.now());
    peer.send_gathered();
    device->wait(std::chrono::milliseconds{20});
    device->receive();
    time.advance(std::chrono::milliseconds{20});
    std::array<protocol::ProbeTrigger, 16> out{};
    const std::size_t n = device->touches().pop(out);
    touches.insert(touches.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
  }
  template <class Done>
  bool cycles_until(std::chrono::nanoseconds limit, Done done) {
    for (const auto end = time.now() + limit; !done(); cycle())
      if (time.now() >= end) return false;
    return true;
  }
  void cycles_for(std::chrono::nanoseconds duration) {
    (void)cycles_until(duration, [] { return false; });
  }
  [[nodiscard]] std::string state() const { return std::string{device->status().state}; }
  [[nodiscard]] std::string last_fault() const { return device->status().last_fault; }
  [[nodiscard]] std::ptrdiff_t times_heard(std::string_view command) {
    const auto& heard = peer.machine().heard();
    return std::ranges::count(heard, command);
  }
  bool state_becomes(std::string_view state) {
    return cycles_until(std::chrono::seconds{30}, [&] { return device->status().state == state; });
  }

  SteppedTime time;
  IppDmePeer peer;
  std::unique_ptr<drivers::IppDevice> device;
  std::vector<protocol::ProbeTrigger> touches;
};

inline sim::IppDmeOptions not_homed(
    std::chrono::nanoseconds home_time = sim::IppDmeOptions{}.home_time) {
  sim::IppDmeOptions machine = machine_with_a_sphere();
  machine.homed = false;
  machine.home_time = home_time;
  return machine;
}

inline drivers::IppDeviceOptions that_may_home() {
  drivers::IppDeviceOptions options;
  options.session.home = true;
  return options;
}

inline drivers::ProbePoint on_top() {
  return {.position_m = {0.1, 0.2, -0.1 + 12.5e-3 + 2e-3}, .normal = {0, 0, 1}};
}

inline constexpr std::string_view kHeld = "awaiting release";

/// Ready, then on its way: 0.5 m at 0.2 m/s.
struct MovingStage : IppStage {
  explicit MovingStage(drivers::IppDeviceOptions options = {},
                       const sim::IppDmeOptions& machine = machine_with_a_sphere())
      : IppStage(machine, std::move(options)) {
    EXPECT_TRUE(state_becomes("ready")) << last_fault();
    device->measure({.position_m = {0.3, 0.4, 0.0}, .touch = false});
    EXPECT_TRUE(cycles_until(std::chrono::seconds{1}, [this] { return peer.machine().moving(); }));
  }
  /// Stopped by one AbortE and held; nothing clears or moves for a minute.
  void expect_stopped_and_held() {
    EXPECT_TRUE(cycles_until(std::chrono::seconds{10}, [this] { return state() == kHeld; }))
        << state() << ": " << last_fault();
    EXPECT_FALSE(peer.machine().moving());
    EXPECT_EQ(times_heard("AbortE()"), 1);
    const auto commands = times_heard("ClearAllErrors()") + times_heard("StartSession()");
    device->measure(on_top());
    cycles_for(std::chrono::seconds{60});
    EXPECT_EQ(state(), kHeld);
    EXPECT_EQ(times_heard("ClearAllErrors()") + times_heard("StartSession()"), commands);
    EXPECT_FALSE(peer.machine().moving());
    EXPECT_EQ(peer.machine().touches(), 0u);
    EXPECT_EQ(device->points_left(), 0u);
  }
  [[nodiscard]] std::size_t commands() { return peer.machine().heard().size(); }
  [[nodiscard]] std::vector<std::string> commands_after(std::size_t n) {
    const auto& heard = peer.machine().heard();
    return {heard.begin() + static_cast<std::ptrdiff_t>(n), heard.end()};
  }
  void inject(sim::FaultKind kind, double value = 0.0) {
    peer.machine().inject({.kind = kind, .value = value}, time.now());
  }
};

}  // namespace abbe::tests
