#include "abbe/drivers/interpolation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::interpolate_axes;
using drivers::InterpolationError;
using drivers::InterpolationOptions;
using protocol::AxisSample;
using protocol::HostTime;
using std::chrono::nanoseconds;

/// One axis that follows `position_m(seconds)`, sampled at the given milliseconds.
std::vector<AxisSample> sampled(const std::vector<int>& at_ms,
                                const std::function<double(double)>& position_m) {
  std::vector<AxisSample> samples;
  for (const int ms : at_ms) {
    AxisSample s;
    s.head.time = HostTime{std::chrono::milliseconds{ms}};
    s.axis_count = 1;
    s.position[0] = position_m(1e-3 * ms);
    samples.push_back(s);
  }
  return samples;
}

const auto standing = [](double) { return 0.25; };

TEST(InterpolateAxes, FollowsConstantSpeed) {
  const auto samples = sampled({0, 1, 2, 3}, [](double t) { return 1.0 + 0.5 * t; });
  const auto at = interpolate_axes(samples, HostTime{1300us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->position[0], 1.0 + 0.5 * 0.0013, 1e-15);
  EXPECT_NEAR(at->velocity[0], 0.5, 1e-10);
}

TEST(InterpolateAxes, FollowsConstantAcceleration) {
  const auto samples = sampled({0, 1, 2, 3}, [](double t) { return 2.5 * t * t; });
  const auto at = interpolate_axes(samples, HostTime{1500us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->position[0], 2.5 * 0.0015 * 0.0015, 1e-15);
  EXPECT_NEAR(at->velocity[0], 5.0 * 0.0015, 1e-12);
}

TEST(InterpolateAxes, DrawsAStraightLineWithoutNeighbours) {
  const auto samples = sampled({1, 2}, [](double t) { return 2.5 * t * t; });
  const auto at = interpolate_axes(samples, HostTime{1500us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->position[0], 2.5 * (1e-6 + 4e-6) / 2.0, 1e-15);
  EXPECT_NEAR(at->velocity[0], 2.5 * (4e-6 - 1e-6) / 1e-3, 1e-12);
}

TEST(InterpolateAxes, DrawsAStraightLineWhereANeighbourIsFarAway) {
  const auto samples = sampled({0, 2, 3, 4}, [](double t) { return 2.5 * t * t; });
  const auto at = interpolate_axes(samples, HostTime{2500us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->position[0], 2.5 * (4e-6 + 9e-6) / 2.0, 1e-15);
}

TEST(InterpolateAxes, DrawsAStraightLineWhereANeighbourHasTheSameInstant) {
  for (const auto& at_ms : {std::vector{0, 1, 1, 2, 3}, std::vector{0, 1, 2, 2, 3}}) {
    const auto at = interpolate_axes(sampled(at_ms, standing), HostTime{1500us}, 0ns);
    ASSERT_TRUE(at);
    EXPECT_EQ(at->position[0], 0.25);
    EXPECT_EQ(at->velocity[0], 0.0);
  }
}

TEST(InterpolateAxes, HitsTheSampleAtItsInstant) {
  const auto samples = sampled({0, 1, 2, 3}, [](double t) { return std::sin(300.0 * t); });
  const auto at = interpolate_axes(samples, HostTime{1ms}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_DOUBLE_EQ(at->position[0], samples[1].position[0]);
  EXPECT_DOUBLE_EQ(at->u_position[0], 0.0);
}

TEST(InterpolateAxes, StatesTheAccelerationBoundInTheMiddle) {
  const auto samples = sampled({1, 2}, standing);
  InterpolationOptions options;
  options.max_acceleration[0] = 8.0;
  const auto at = interpolate_axes(samples, HostTime{1500us}, 0ns, options);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->u_position[0], 8.0 / 2.0 * 0.0005 * 0.0005 / std::sqrt(3.0), 1e-15);
}

TEST(InterpolateAxes, AddsSpeedTimesTimeUncertainty) {
  auto samples = sampled({0, 1, 2, 3}, [](double t) { return 0.2 * t; });
  for (auto& s : samples) s.head.u_time = 30us;
  InterpolationOptions options;
  options.max_acceleration[0] = 0.0;
  const auto at = interpolate_axes(samples, HostTime{1500us}, 40us, options);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->u_position[0], 0.2 * 50e-6, 1e-12);
}

// Any motion within the acceleration bound stays within the bound stated: a new random
// acceleration every 0.1 ms of the largest size (plus or minus the bound), worse than any machine.
TEST(InterpolateAxes, KeepsItsErrorWithinTheStatedBound) {
  constexpr double kBound = 5.0;
  constexpr double kStep_s = 1e-4;
  std::mt19937 random(20);

  for (int run = 0; run < 2000; ++run) {
    std::vector<double> x{0.0};
    double v = 0.1;
    for (int i = 0; i < 30; ++i) {
      const double a = random() % 2 == 0 ? kBound : -kBound;
      x.push_back(x.back() + v * kStep_s + 0.5 * a * kStep_s * kStep_s);
      v += a * kStep_s;
    }

    const auto samples = sampled({0, 1, 2, 3}, [&](double t) {
      return x[static_cast<std::size_t>(std::lround(t / kStep_s))];
    });

    for (std::size_t k = 11; k < 20; ++k) {
      const auto at = interpolate_axes(samples, HostTime{k * 100us}, 0ns);
      ASSERT_TRUE(at);
      EXPECT_LE(std::abs(at->position[0] - x[k]), std::sqrt(3.0) * at->u_position[0] + 1e-15)
          << "run " << run;
    }
  }
}

TEST(InterpolateAxes, RefusesInstantsOutsideTheSamples) {
  const auto samples = sampled({1, 2}, standing);
  EXPECT_EQ(interpolate_axes(samples, HostTime{999us}, 0ns).error(), InterpolationError::TooEarly);
  EXPECT_EQ(interpolate_axes(samples, HostTime{2001us}, 0ns).error(), InterpolationError::TooLate);
  EXPECT_EQ(interpolate_axes({}, HostTime{1ms}, 0ns).error(), InterpolationError::TooEarly);
}

TEST(InterpolateAxes, RefusesToBridgeAGap) {
  const auto samples = sampled({1, 2, 6, 7}, standing);
  EXPECT_EQ(interpolate_axes(samples, HostTime{4ms}, 0ns).error(), InterpolationError::Gap);
  EXPECT_TRUE(interpolate_axes(samples, HostTime{1500us}, 0ns));
}

TEST(InterpolateAxes, NamesTheAxesThatDidNotAnswer) {
  auto samples = sampled({0, 1, 2, 3}, standing);
  for (auto& s : samples) s.axis_count = 3;
  samples[1].missing_mask = 0b001;
  samples[2].missing_mask = 0b100;
  samples[2].head.flags |= protocol::SampleFlag::AxisMissing;
  const auto at = interpolate_axes(samples, HostTime{1500us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_EQ(at->missing_mask, 0b101);
  EXPECT_TRUE(has(at->flags, protocol::SampleFlag::AxisMissing));
}

TEST(InterpolateAxes, UsesNoNeighbourThatDidNotAnswer) {
  auto samples = sampled({0, 1, 2, 3}, [](double t) { return 0.5 * t; });
  samples[0].position[0] = 99.0;  // stale
  samples[0].missing_mask = 1;
  const auto at = interpolate_axes(samples, HostTime{1500us}, 0ns);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->position[0], 0.5 * 0.0015, 1e-15);
}

TEST(LatestAxes, AreThoseOfTheSampleWithTheSlopeToTheOneBefore) {
  auto samples = sampled({5, 6}, [](double t) { return 1.0 + 0.5 * t; });
  samples[1].head.u_time = 50us;
  const auto at = drivers::latest_axes(&samples[0], samples[1]);
  EXPECT_EQ(at.time, HostTime{6ms});
  EXPECT_EQ(at.position[0], samples[1].position[0]);
  EXPECT_NEAR(at.velocity[0], 0.5, 1e-10);
  EXPECT_NEAR(at.u_position[0], 0.5 * 50e-6, 1e-14);
}

TEST(LatestAxes, HaveNoSpeedWithoutAnAnswerBeforeAndNow) {
  auto samples = sampled({5, 6, 60}, [](double t) { return 1.0 + 0.5 * t; });
  EXPECT_EQ(drivers::latest_axes(nullptr, samples[1]).velocity[0], 0.0);
  EXPECT_EQ(drivers::latest_axes(&samples[1], samples[0]).velocity[0], 0.0) << "later";
  EXPECT_EQ(drivers::latest_axes(&samples[1], samples[2]).velocity[0], 0.0) << "long ago";
  samples[1].missing_mask = 1;
  samples[1].position[0] = 99.0;
  const auto at = drivers::latest_axes(&samples[0], samples[1]);
  EXPECT_EQ(at.velocity[0], 0.0);
  EXPECT_EQ(at.missing_mask, 1);
}

}  // namespace
}  // namespace abbe::tests
