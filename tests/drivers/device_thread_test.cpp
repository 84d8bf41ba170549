#include "abbe/drivers/device_thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <atomic>
#include <stdexcept>
#include <thread>

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::DeviceThread;
using drivers::DeviceThreadOptions;
using drivers::RealTimeMode;

/// Counts its cycles and, on request, throws in one of them.
class CycleCounter final : public drivers::Device {
 public:
  explicit CycleCounter(int throw_in_cycle = -1) : throw_in_cycle_(throw_in_cycle) {}
  void wait(std::chrono::nanoseconds at_most) override {
    waited_at_most = at_most;
    if (turns == throw_in_cycle_ && throws) throw std::runtime_error("no such register");
    std::this_thread::yield();
  }
  void receive() ABBE_RT override { ++turns; }
  [[nodiscard]] drivers::DeviceStatus status() const override {
    drivers::DeviceStatus s;
    s.state = "streaming";
    s.connected = true;
    return s;
  }

  std::atomic<bool> throws{true};
  std::atomic<int> turns{0};
  std::atomic<std::chrono::nanoseconds> waited_at_most{};

 private:
  int throw_in_cycle_;
};

void wait_for(const std::function<bool()>& done) {
  while (!done()) std::this_thread::yield();  // bounded by the test's own time-out
}

TEST(DeviceThread, RunsCyclesUntilStopped) {
  CycleCounter device;
  auto thread = DeviceThread::start(device, {.wait_at_most = 7ms});
  ASSERT_TRUE(thread);
  wait_for([&] { return device.turns > 10; });
  (*thread)->stop();
  const int turns = device.turns;
  EXPECT_EQ(device.waited_at_most.load(), 7ms);
  EXPECT_FALSE((*thread)->failure());
  std::this_thread::yield();
  EXPECT_EQ(device.turns, turns);
}

TEST(DeviceThread, FillsALatencyHistogramWithEveryCycle) {
  CycleCounter device;
  auto thread = DeviceThread::start(device, {});
  ASSERT_TRUE(thread);
  wait_for([&] { return device.turns > 10; });
  (*thread)->stop();
  EXPECT_EQ((*thread)->latency().read().total, static_cast<std::uint64_t>(device.turns));
}

TEST(DeviceThread, HandsOverTheExceptionThatEndedIt) {
  CycleCounter device(3);
  auto thread = DeviceThread::start(device, {});
  ASSERT_TRUE(thread);
  wait_for([&] { return (*thread)->failure().has_value(); });
  EXPECT_EQ(*(*thread)->failure(), "no such register");
  EXPECT_EQ(device.turns, 3);
}

TEST(DeviceThread, NeverReportsStreamingAfterItsLoopHasEnded) {
  CycleCounter device(3);
  const auto thread = DeviceThread::start(device, {.name = "tracker", .first_back_off = 1h});
  ASSERT_TRUE(thread);
  wait_for([&] { return (*thread)->failure().has_value(); });
  wait_for([&] { return (*thread)->failures() == 1; });
  const auto status = (*thread)->status();
  EXPECT_EQ(status.state, "internal error");
  EXPECT_FALSE(status.connected);
  EXPECT_EQ(status.faults, 1u);
  EXPECT_THAT(status.last_fault, testing::HasSubstr("tracker: internal error"));
  EXPECT_THAT(status.last_fault, testing::HasSubstr("no such register"));
}

TEST(DeviceThread, FailureIsReportedOnlyAfterTheThreadHasEnded) {
  for (int i = 0; i < 200; ++i) {
    CycleCounter device(0);
    const auto thread = DeviceThread::start(device, {.wait_at_most = 1us, .first_back_off = 1h});
    ASSERT_TRUE(thread);
    while ((*thread)->failures() == 0) {
    }
    ASSERT_FALSE((*thread)->status().connected) << i;
  }
}

TEST(DeviceThread, BeginsAgainAfterAnException) {
  CycleCounter device(3);
  const auto thread = DeviceThread::start(
      device, {.wait_at_most = 1ms, .first_back_off = 100us, .longest_back_off = 400us});
  ASSERT_TRUE(thread);
  wait_for([&] { return (*thread)->failures() > 4; });
  EXPECT_FALSE((*thread)->status().connected);
  device.throws = false;
  wait_for([&] { return device.turns > 10; });
  EXPECT_FALSE((*thread)->failure());
  EXPECT_TRUE((*thread)->status().connected);
  EXPECT_EQ((*thread)->status().faults, (*thread)->failures());
}

/// Moves a machine, and throws in each wait() until it was told to stop `stops_needed` times.
class MovingDevice final : public drivers::Device {
 public:
  explicit MovingDevice(int stops_needed) : stops_needed_(stops_needed) {}
  void wait(std::chrono::nanoseconds) override {
    if (stops < stops_needed_) throw std::runtime_error("no memory");
    std::this_thread::yield();
  }
  void receive() ABBE_RT override { ++turns; }
  [[nodiscard]] drivers::DeviceStatus status() const override { return {}; }
  [[nodiscard]] bool stop_after_failure() override {
    if (++stops < stops_needed_) throw std::runtime_error("no memory for the stop either");
    return true;
  }

  std::atomic<int> stops{0};
  std::atomic<int> turns{0};

 private:
  int stops_needed_;
};

TEST(DeviceThread, StopsAMotionAtOnceAndGoesOnWithoutItsPause) {
  MovingDevice device(1);
  const auto thread = DeviceThread::start(device, {.first_back_off = 1h, .longest_back_off = 1h});
  ASSERT_TRUE(thread);
  wait_for([&] { return device.turns > 0; });
  EXPECT_EQ(device.stops, 1);
  EXPECT_EQ((*thread)->failures(), 1u);
}

TEST(DeviceThread, TriesAgainToStopAMotionThatItCannotStop) {
  MovingDevice device(5);
  const auto thread = DeviceThread::start(device, {.first_back_off = 1h, .longest_back_off = 1h});
  ASSERT_TRUE(thread);
  wait_for([&] { return device.turns > 0; });
  EXPECT_EQ(device.stops, 5);
}

// No machine has processor 1023 in its set: a refusal that does not depend on who runs the test.
constexpr int kNoSuchProcessor = 1023;

TEST(DeviceThread, RefusesToStartInEnforceMode) {
  CycleCounter device;
  const auto thread = DeviceThread::start(
      device, {.name = "tracker", .mode = RealTimeMode::Enforce, .cpu = kNoSuchProcessor});
  ASSERT_FALSE(thread);
  EXPECT_EQ(thread.error().code, drivers::ErrorCode::SystemRefused);
  EXPECT_THAT(thread.error().text,
              testing::HasSubstr("thread tracker: affinity to processor 1023"));
  EXPECT_EQ(device.turns, 0);
}

TEST(DeviceThread, WarnsAndRunsInIgnoreMode) {
  CycleCounter device;
  const auto thread =
      DeviceThread::start(device, {.mode = RealTimeMode::Ignore, .cpu = kNoSuchProcessor});
  ASSERT_TRUE(thread);
  ASSERT_EQ((*thread)->warnings().size(), 1u);
  EXPECT_THAT((*thread)->warnings()[0], testing::HasSubstr("affinity"));
  wait_for([&] { return device.turns > 0; });
}

TEST(DeviceThread, ReportsEverythingTheSystemRefusedAtOnce) {
  CycleCounter device;
  const auto thread = DeviceThread::start(
      device, {.mode = RealTimeMode::Enforce, .priority = 1000, .cpu = kNoSuchProcessor});
  ASSERT_FALSE(thread);
  EXPECT_THAT(thread.error().text, testing::AllOf(testing::HasSubstr("affinity"),
                                                  testing::HasSubstr("SCHED_FIFO priority 1000")));
}

TEST(DeviceThread, RunsOnItsConfiguredProcessor) {
  class Where final : public drivers::Device {
   public:
    void wait(std::chrono::nanoseconds) override { cpu = sched_getcpu(); }
    void receive() ABBE_RT override {}
    [[nodiscard]] drivers::DeviceStatus status() const override { return {}; }
    std::atomic<int> cpu{-1};
  } device;
  const int here = sched_getcpu();
  const auto thread = DeviceThread::start(device, {.mode = RealTimeMode::Enforce, .cpu = here});
  ASSERT_TRUE(thread) << thread.error().text;
  wait_for([&] { return device.cpu >= 0; });
  EXPECT_EQ(device.cpu, here);
}

TEST(DeviceThread, LocksMemoryWithoutHugePages) {
  CycleCounter device;
  const auto thread = DeviceThread::start(device, {.lock_memory = true});
  ASSERT_TRUE(thread) << thread.error().text;
  EXPECT_EQ(::prctl(PR_GET_THP_DISABLE, 0, 0, 0, 0), 1);
  ::munlockall();
}

}  // namespace
}  // namespace abbe::tests
