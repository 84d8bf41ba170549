/// A machine that follows the position records of a control.

#include "abbe/sim/followed_motion.hpp"

#include <gmock/gmock.h>
#include <sys/socket.h>

#include <cmath>
#include <random>
#include <thread>

#include "abbe/sim/simulation.hpp"

namespace abbe::sim {
namespace {

using protocol::PositionRecord;

constexpr std::chrono::nanoseconds kPeriod = std::chrono::milliseconds{1};
constexpr double kSpeed_m_per_s = 0.1;

HostTime followed_time(double s) {
  return HostTime{seconds_to_ns(1000.0 + s)};
}

/// X moves with 100 mm/s, Z in the opposite direction at half the speed.
PositionRecord record_at(std::uint32_t cycle, double s) {
  return {.homed = true,
          .cycle = cycle,
          .period_ns = 1'000'000,
          .position_m = {kSpeed_m_per_s * s, 0.25, -0.5 * kSpeed_m_per_s * s}};
}

TEST(FollowedMotion, IsThatOfTheControlAlthoughRecordsArriveLate) {
  FollowedMotion motion;
  std::mt19937 random(3);
  std::exponential_distribution<double> late_s(1.0 / 0.3e-3);
  constexpr double kLatency_s = 0.2e-3;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    const double s = 1e-3 * i;
    motion.add(record_at(0xffffff00 + i, s), followed_time(s + kLatency_s + late_s(random)));
  }
  // The smallest delay of a tenth of a second is 0.2 ms and some microseconds.
  constexpr double kTime_s = 40e-6;
  for (const double s : {0.1, 0.5, 0.9876}) {
    const auto at = motion.at(followed_time(s + kLatency_s));
    ASSERT_TRUE(at);
    EXPECT_NEAR(at->q_m.x(), kSpeed_m_per_s * s, kTime_s * kSpeed_m_per_s);
    EXPECT_NEAR(at->velocity_m_per_s.x(), kSpeed_m_per_s, 1e-9);
    EXPECT_EQ(at->direction, (std::array{1, 0, -1}));
  }
  EXPECT_EQ(motion.counts().received, 1000U);
  EXPECT_EQ(motion.counts().lost, 0U);
  EXPECT_EQ(motion.counts().restarts, 0U);
}

TEST(FollowedMotion, StandsBeforeTheFirstAndAfterTheLastRecord) {
  FollowedMotion motion;
  EXPECT_FALSE(motion.at(followed_time(0.0)));
  for (std::uint32_t i = 0; i <= 100; ++i)
    motion.add(record_at(i, 1e-3 * i), followed_time(1e-3 * i));
  EXPECT_EQ(motion.at(followed_time(-1.0))->q_m.x(), 0.0);
  EXPECT_NEAR(motion.at(followed_time(0.110))->q_m.x(), 0.110 * kSpeed_m_per_s, 1e-12)
      << "goes on for a short time";
  const auto later = motion.at(followed_time(0.2));
  EXPECT_NEAR(later->q_m.x(), 0.12 * kSpeed_m_per_s, 1e-12) << "where it was after 20 ms";
  EXPECT_EQ(later->velocity_m_per_s.norm(), 0.0);
  EXPECT_EQ(motion.first(), followed_time(0.0));
}

TEST(FollowedMotion, CountsLostOldAndUnhomedRecordsAndRestarts) {
  FollowedMotion motion;
  PositionRecord unhomed = record_at(1, 0.0);
  unhomed.homed = false;
  motion.add(unhomed, followed_time(0.0));
  EXPECT_FALSE(motion.at(followed_time(0.0)));
  EXPECT_EQ(motion.counts().not_homed, 1U);

  motion.add(record_at(10, 0.010), followed_time(0.010));
  motion.add(record_at(14, 0.014), followed_time(0.014));
  EXPECT_EQ(motion.counts().lost, 3U);
  motion.add(record_at(12, 99.0), followed_time(0.0145));  // overtaken
  EXPECT_EQ(motion.counts().received, 2U);
  EXPECT_NEAR(motion.at(followed_time(0.012))->q_m.x(), 0.012 * kSpeed_m_per_s, 1e-12);

  motion.add(record_at(5, 0.5), followed_time(60.0));  // the control started again
  EXPECT_EQ(motion.counts().restarts, 1U);
  EXPECT_NEAR(motion.at(followed_time(60.0))->q_m.x(), 0.5 * kSpeed_m_per_s, 1e-12);

  unhomed.cycle = 6;
  motion.add(unhomed, followed_time(60.001));
  motion.add(record_at(10'005, 0.7), followed_time(70.0));  // homed again after 10 s
  EXPECT_EQ(motion.counts().lost, 3U) << "not lost, not homed";
  EXPECT_EQ(motion.counts().restarts, 1U);
  EXPECT_NEAR(motion.at(followed_time(65.0))->q_m.x(), 0.7 * kSpeed_m_per_s, 1e-12);
}

TEST(FollowedMotion, FollowsAControlWhosePeriodIsLonger) {
  FollowedMotion motion;
  constexpr double kTrue_s = 1.00005e-3;  // 50 ppm
  double now_s = 0.0;
  for (std::uint32_t i = 0; i < 200'000; ++i) {
    now_s = kTrue_s * i;
    motion.add(record_at(i, now_s), followed_time(now_s));
  }
  EXPECT_NEAR(motion.at(followed_time(now_s - 0.5))->q_m.x(), kSpeed_m_per_s * (now_s - 0.5), 5e-6);
  EXPECT_EQ(motion.counts().restarts, 0U);
}

TEST(FollowedMotion, ARecordThatWasReadWithOthersDoesNotMoveTheClock) {
  FollowedMotion motion;
  motion.add(record_at(0, 0.0), followed_time(0.0));
  // The clock was read, then the reader was stopped for 50 ms: all records have the early time.
  for (std::uint32_t i = 1; i <= 50; ++i)
    motion.add(record_at(i, 1e-3 * i), followed_time(1e-3), i == 1);
  EXPECT_NEAR(motion.at(followed_time(0.025))->q_m.x(), 0.025 * kSpeed_m_per_s, 1e-6);
}

TEST(FollowedMotion, KeepsTwoSeconds) {
  FollowedMotion motion;
  for (std::uint32_t i = 0; i < 10'000; ++i)
    motion.add(record_at(i, 1e-3 * i), followed_time(1e-3 * i));
  EXPECT_NEAR(motion.at(followed_time(8.5))->q_m.x(), 8.5 * kSpeed_m_per_s, 1e-9);
  EXPECT_NEAR(motion.at(followed_time(1.0))->q_m.x(), 7.999 * kSpeed_m_per_s, 1e-9) << "forgotten";
}

TEST(ControlPort, MovesTheSimulatedMachine) {
  SimulationSetup setup;
  setup.path.vertices = {{{0.1, 0.2, 0.3}}};
  setup.control_port = 0;
  auto simulation = Simulation::open(setup, followed_time(0.0));
  ASSERT_TRUE(simulation) << simulation.error().text;
  Simulation& s = **simulation;
  s.poll(followed_time(0.001));
  EXPECT_EQ(s.machine().motion(followed_time(0.001)).q_m.x(), 0.1);
  EXPECT_FALSE(s.machine().started());

  const auto sender = bind_udp(0);
  ASSERT_TRUE(sender);
  const sockaddr_storage to = loopback_address(s.control()->port());
  const auto send = [&](std::span<const std::byte> bytes) {
    EXPECT_EQ(::sendto(sender->get(), bytes.data(), bytes.size(), 0,
                       reinterpret_cast<const sockaddr*>(&to), sizeof(sockaddr_in)),
              std::ssize(bytes));
  };
  send(protocol::encode(record_at(1, 0.5)));
  const std::array<std::byte, 3> garbage{};
  send(garbage);
  s.poll(followed_time(0.5));
  EXPECT_NEAR(s.machine().motion(followed_time(0.5)).q_m.x(), 0.5 * kSpeed_m_per_s, 1e-15);
  EXPECT_EQ(s.machine().started(), followed_time(0.5));
  EXPECT_EQ(s.control()->not_records(), 1U);
}

}  // namespace
}  // namespace abbe::sim
