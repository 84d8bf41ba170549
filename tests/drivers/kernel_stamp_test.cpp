#include "abbe/drivers/kernel_stamp.hpp"

#include <gtest/gtest.h>

#include "abbe/drivers/clock_model.hpp"
#include "burst_profile.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::Arrival;
using drivers::ClockModel;
using drivers::ClockPair;
using drivers::KernelStampMap;
using protocol::HostTime;
using std::chrono::nanoseconds;

constexpr nanoseconds kWall = 1'700'000'000s;  // wall clock at monotonic zero

/// Both clocks at a monotonic instant, the wall clock stepped by `step`.
ClockPair at(nanoseconds monotonic, nanoseconds step = 0ns) {
  return {monotonic, kWall + monotonic + step};
}

/// A map of a queue that was empty at 10 s.
KernelStampMap begun(double speed = 1.0) {
  KernelStampMap map(speed);
  map.nothing_older_than(at(10s));
  return map;
}

TEST(KernelStampMap, TakesTheAgeOfTheStampOffTheHostTime) {
  KernelStampMap map = begun();
  const Arrival a = map.arrival(kWall + 10300ms, at(10305ms), HostTime{10305ms});
  EXPECT_EQ(a.time, HostTime{10300ms});
  EXPECT_FALSE(a.widened);
  EXPECT_LT(a.u_time, 100us);
}

TEST(KernelStampMap, ScalesTheAgeWithSimulatedTime) {
  KernelStampMap map = begun(10.0);
  EXPECT_EQ(map.arrival(kWall + 10300ms, at(10305ms), HostTime{103050ms}).time, HostTime{103000ms});
}

TEST(KernelStampMap, FallsBackToUserSpaceTimeWithoutAStamp) {
  KernelStampMap map = begun();
  const Arrival a = map.arrival(std::nullopt, at(10300ms), HostTime{10300ms});
  EXPECT_EQ(a.time, HostTime{10300ms});
  EXPECT_TRUE(a.widened);
  EXPECT_EQ(a.u_time, 1ms);
}

TEST(KernelStampMap, RejectsStampsBeforeTheQueueWasKnownToBeEmpty) {
  KernelStampMap map;
  EXPECT_TRUE(map.arrival(kWall + 10s, at(10s), HostTime{10s}).widened);
}

TEST(KernelStampMap, AcceptsEveryStampOfABatch) {
  KernelStampMap map = begun();
  for (const auto came : {10301ms, 10302ms, 10303ms}) {  // one reading of the clocks for all three
    const Arrival a = map.arrival(kWall + came, at(10305ms), HostTime{10305ms});
    EXPECT_FALSE(a.widened);
    EXPECT_EQ(a.time, HostTime{came});
  }
  EXPECT_EQ(map.widened(), 0u);
}

TEST(KernelStampMap, AcceptsStampsLeftByAReadThatWasTooSmall) {
  KernelStampMap map = begun();
  EXPECT_FALSE(map.arrival(kWall + 10301ms, at(10305ms), HostTime{10305ms}).widened);
  EXPECT_EQ(map.arrival(kWall + 10302ms, at(10309ms), HostTime{10309ms}).time, HostTime{10302ms});
}

TEST(KernelStampMap, RejectsAStampFromTheFuture) {
  KernelStampMap map = begun();
  const Arrival a = map.arrival(kWall + 10301ms, at(10300ms), HostTime{10300ms});
  EXPECT_TRUE(a.widened);
  EXPECT_EQ(a.time, HostTime{10300ms});
}

TEST(KernelStampMap, RejectsAStampOlderThanTheEmptyQueue) {
  KernelStampMap map = begun();
  EXPECT_TRUE(map.arrival(kWall + 9999ms, at(10300ms), HostTime{10300ms}).widened);
}

TEST(KernelStampMap, CountsRejectedStamps) {
  KernelStampMap map = begun();
  const auto before = map.widened();
  map.arrival(std::nullopt, at(10300ms), HostTime{10300ms});
  map.arrival(kWall + 10600ms, at(10601ms), HostTime{10601ms});
  EXPECT_EQ(map.widened(), before + 1);
}

TEST(KernelStampMap, DetectsAStepTooSmallToAppearInTheAge) {
  KernelStampMap map = begun();
  // stamped, then the wall clock was put forward by 100 ms: the age would be 101 ms of 300 possible
  // ones
  const Arrival a = map.arrival(kWall + 10299ms, at(10300ms, 100ms), HostTime{10300ms});
  EXPECT_TRUE(a.widened);
  EXPECT_EQ(a.time, HostTime{10300ms});
}

TEST(KernelStampMap, AcceptsStampsAgainAfterAStep) {
  KernelStampMap map = begun();
  map.arrival(kWall + 10299ms, at(10300ms, 3600s), HostTime{10300ms});
  map.nothing_older_than(at(10300ms, 3600s));
  const Arrival a = map.arrival(kWall + 3600s + 10599ms, at(10600ms, 3600s), HostTime{10600ms});
  EXPECT_FALSE(a.widened);
  EXPECT_EQ(a.time, HostTime{10599ms});
}

/// Two minutes of bursts, stamped by the kernel 0.2 ms before user space reads both clocks; the
/// wall clock is stepped by `step` after one minute. Where the model then puts an instant.
HostTime mapped_with_step(nanoseconds step) {
  BurstProfile profile(5, {});
  KernelStampMap map;
  ClockModel model;
  while (profile.last_point_s() < 120.0) {
    const Packet p = profile.next();
    const nanoseconds read_at = p.arrival.time_since_epoch() + 200us;
    const nanoseconds wall_step = profile.last_point_s() < 60.0 ? 0ns : step;
    const ClockPair now = at(read_at, wall_step);
    model.observe(p.last_point, map.arrival(now.realtime - 200us, now, HostTime{read_at}).time);
    map.nothing_older_than(now);
  }
  return model.to_host(profile.device_at(120.0)).time;
}

TEST(KernelStampMap, LetsAWallClockStepChangeNothing) {
  const HostTime undisturbed = mapped_with_step(0ns);
  for (const nanoseconds step :
       {nanoseconds{3600s}, nanoseconds{-3600s}, nanoseconds{100ms}, nanoseconds{-100ms}}) {
    // the one packet around the step is read by user space, 0.2 ms later; no other differs
    EXPECT_LT(std::chrono::abs(mapped_with_step(step) - undisturbed), 1us) << step.count() << " ns";
  }
}

}  // namespace
}  // namespace abbe::tests
