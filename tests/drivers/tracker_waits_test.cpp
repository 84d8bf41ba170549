/// How often the device thread of a tracker wakes up: it runs at real-time priority, so a loop
/// without a wait takes a processor from everybody else.

#include <gtest/gtest.h>

#include "abbe/drivers/tracker/device.hpp"
#include "tracker_peer.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;

/// Passes as a wait asks it to: a wait without length lets no time pass.
class WaitingTime final : public TimeSource {
 public:
  [[nodiscard]] protocol::HostTime now() const noexcept override { return now_; }
  [[nodiscard]] std::chrono::nanoseconds wall(
      std::chrono::nanoseconds host) const noexcept override {
    asked_ = host;
    return {};
  }
  [[nodiscard]] std::chrono::nanoseconds host(std::chrono::nanoseconds) const noexcept override {
    return {};
  }
  /// Until the wait ends, or until something comes within it.
  void pass() { now_ += std::min<std::chrono::nanoseconds>(asked_, kAnswerWithin); }

 private:
  static constexpr std::chrono::milliseconds kAnswerWithin{20};
  protocol::HostTime now_{1h};
  mutable std::chrono::nanoseconds asked_{};
};

class TrackerWaits : public testing::Test {
 protected:
  TrackerWaits() {
    TrackerDeviceOptions options;
    options.host = "127.0.0.1";
    options.port = peer_.port();
    device_ = TrackerDevice::create(options, time_).value();
  }

  void cycle() {
    peer_.serve(time_.now());
    peer_.send_points();
    device_->wait(50ms);
    device_->receive();
    time_.pass();
  }
  /// No more than 100,000.
  int cycles_in(std::chrono::nanoseconds duration) {
    int count = 0;
    for (const auto end = time_.now() + duration; time_.now() < end && count < 100'000; ++count)
      cycle();
    return count;
  }
  bool reaches(std::string_view state) {
    for (int i = 0; i < 10'000 && device_->status().state != state; ++i) cycle();
    return device_->status().state == state;
  }
  void inject(sim::FaultKind kind, double duration_s) {
    peer_.controller().inject({kind, 0.0, duration_s, 0.0, 0}, time_.now());
  }

  WaitingTime time_;
  tests::tracker::TrackerPeer peer_{time_.now()};
  std::unique_ptr<TrackerDevice> device_;
};

// Fifty cycles of 20 ms a second, and one for each of a few packets.
constexpr int kMostPerSecond = 60;

TEST_F(TrackerWaits, AreAsLongWithoutABeamAsWithIt) {
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_LT(cycles_in(10s), 10 * kMostPerSecond);
  inject(sim::FaultKind::BeamBreak, 20.0);
  EXPECT_LT(cycles_in(20s), 20 * kMostPerSecond);
}

TEST_F(TrackerWaits, AreAsLongWhenTheKeepAliveFallsDueWhileAnAnswerIsAwaited) {
  ASSERT_TRUE(reaches("streaming"));
  cycles_in(2s);
  inject(sim::FaultKind::BeamBreak,
         3.9);  // StartMeasurement follows 1 s after, the keep-alive is due at 5 s
  cycles_in(4s);
  inject(sim::FaultKind::Mute, 3.5);
  EXPECT_LT(cycles_in(3500ms), 4 * kMostPerSecond);
}

}  // namespace
}  // namespace abbe::drivers
