#include "abbe/pipeline/environment_use.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "abbe/pipeline/assembler.hpp"
#include "abbe/pipeline/live_view.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::EnvironmentSample;
using protocol::HostTime;
using protocol::SampleFlag;

constexpr HostTime kUseStart{100s};
constexpr auto kLag = 600ms;

EnvironmentSample weather(HostTime t, double air_K) {
  EnvironmentSample s;
  s.head.time = t;
  s.air_temperature_K = air_K;
  s.air_pressure_Pa = 101'325.0;
  s.relative_humidity = 0.5;
  return s;
}
/// Scale temperature on channel 2, nothing else.
EnvironmentSample scale_at(HostTime t, double t_K) {
  EnvironmentSample s = weather(t, std::nan(""));
  s.measured = protocol::temperature_bit(2);
  s.temperature_K[2] = t_K;
  return s;
}
Batch measured(std::initializer_list<EnvironmentSample> samples, std::size_t device = 0) {
  Batch b;
  for (const auto& s : samples) b.measured_environment.push_back({device, s});
  return b;
}

EnvironmentUseOptions with_scale() {
  EnvironmentUseOptions use;
  use.measured = protocol::temperature_bit(2);
  const ThermalConfig x{.axis = "X",
                        .temperature = 2,
                        .alpha_per_K = 8e-6,
                        .u_alpha_per_K = 0.5e-6,
                        .u_temperature_K = 0.2,
                        .fixed_m = 0.1};
  use.thermal.push_back(ThermalAxis{0, x});
  return use;
}

protocol::Snapshot at_one_metre(std::optional<double> scale_K) {
  protocol::Snapshot s;
  s.axis_count = 3;
  s.position = {1.1, 0.2, 0.3};
  s.velocity = {0.01, 0.0, 0.0};
  s.u_position = {1e-6, 1e-6, 1e-6};
  if (scale_K) {
    s.has_environment = true;
    s.environment.temperature_K[2] = *scale_K;
  }
  return s;
}

TEST(EnvironmentMerge, TakesAQuantityFromTheDeviceThatMeasuresIt) {
  EnvironmentMerge merge{{.measured = protocol::kAirTemperature}, kLag};
  Batch b;
  b.environment = {weather(kUseStart, 290.0)};
  auto air = weather(kUseStart, 295.0);
  air.measured = protocol::kAirTemperature;
  b.measured_environment = {{0, air}};
  merge.take(b);
  const auto e = merge.at(kUseStart + 1s);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->air_temperature_K, 295.0);
  EXPECT_EQ(e->air_pressure_Pa, 101'325.0);
}

TEST(EnvironmentMerge, NeverFallsBackToTheTrackerForWhatADeviceIsToMeasure) {
  EnvironmentMerge merge{{.measured = protocol::kAirTemperature}, kLag};
  Batch b;
  b.environment = {weather(kUseStart, 290.0)};
  merge.take(b);
  const auto e = merge.at(kUseStart + 1s);
  ASSERT_TRUE(e);
  EXPECT_TRUE(std::isnan(e->air_temperature_K));
}

TEST(EnvironmentMerge, LeavesOutAirThatATrackerAssumes) {
  EnvironmentMerge merge{{}, kLag};
  Batch b;
  b.environment = {weather(kUseStart, 293.15)};
  b.environment[0].measured = 0;
  merge.take(b);
  EXPECT_FALSE(merge.at(kUseStart + 1s));
  merge.take(measured({scale_at(kUseStart, 293.0)}));
  EXPECT_TRUE(std::isnan(merge.at(kUseStart + 1s)->air_temperature_K));
}

TEST(EnvironmentMerge, MergesTheTemperaturesOfSeveralDevices) {
  EnvironmentMerge merge{{}, kLag};
  auto other = weather(kUseStart, 0.0);
  other.measured = protocol::temperature_bit(0);
  other.temperature_K[0] = 300.0;
  merge.take(measured({scale_at(kUseStart, 293.0)}, 0));
  merge.take(measured({other}, 1));
  const auto e = merge.at(kUseStart + 1s);
  ASSERT_TRUE(e);
  EXPECT_EQ(e->temperature_K[0], 300.0);
  EXPECT_EQ(e->temperature_K[2], 293.0);
}

TEST(EnvironmentMerge, GivesTheSameWhateverTheOrderOfArrival) {
  EnvironmentMerge early{{}, kLag};
  EnvironmentMerge late{{}, kLag};
  const auto first = measured({scale_at(kUseStart, 293.0)});
  const auto second = measured({scale_at(kUseStart + 500ms, 294.0)});
  early.take(first);
  early.take(second);
  late.take(first);
  // This instant is before the second sample: its value must not be used yet.
  EXPECT_EQ(early.at(kUseStart + 900ms)->temperature_K[2],
            late.at(kUseStart + 900ms)->temperature_K[2]);
}

TEST(EnvironmentMerge, TakesSamplesInTheOrderOfTheirInstants) {
  EnvironmentMerge merge{{}, kLag};
  merge.take(measured({scale_at(kUseStart + 500ms, 294.0)}));
  merge.take(measured({scale_at(kUseStart, 293.0)}));
  EXPECT_EQ(merge.at(kUseStart + 600ms)->temperature_K[2], 293.0);
  EXPECT_EQ(merge.at(kUseStart + 1100ms)->temperature_K[2], 294.0);
}

TEST(EnvironmentMerge, DropsTheValueOfASilentDevice) {
  EnvironmentMerge merge{{.max_age = 60s}, kLag};
  merge.take(measured({scale_at(kUseStart, 293.0)}));
  EXPECT_EQ(merge.at(kUseStart + 60s)->temperature_K[2], 293.0);
  EXPECT_TRUE(std::isnan(merge.at(kUseStart + 61s)->temperature_K[2]));
}

TEST(ThermalCorrection, CorrectsAnAxisToItsTruePosition) {
  auto s = at_one_metre(296.15);
  correct_for_temperature(s, with_scale());
  EXPECT_NEAR(s.position[0] - 1.1, 24e-6, 1e-12);  // 1 m from the fixed point, 3 K, 8e-6 / K
  EXPECT_EQ(s.position[1], 0.2);
  EXPECT_EQ(s.missing_mask, 0);
}

TEST(ThermalCorrection, AddsItsUncertainty) {
  auto s = at_one_metre(296.15);
  correct_for_temperature(s, with_scale());
  const double u_m = std::hypot(3.0 * 0.5e-6, 8e-6 * 0.2);
  EXPECT_NEAR(s.u_position[0], std::hypot(1e-6, u_m), 1e-12);
  EXPECT_EQ(s.u_position[1], 1e-6);
}

TEST(ThermalCorrection, MarksAnAxisWithoutItsTemperatureAsUnknown) {
  for (const auto& temperature : {std::optional<double>{}, std::optional{std::nan("")}}) {
    auto s = at_one_metre(temperature);
    correct_for_temperature(s, with_scale());
    EXPECT_EQ(s.missing_mask, 1);
    EXPECT_TRUE(has(s.head.flags, SampleFlag::AxisMissing));
    EXPECT_EQ(s.position[0], 1.1);
  }
}

protocol::Snapshot with_point(double air_K) {
  protocol::Snapshot s;
  s.has_tracker_point = true;
  s.tracker_point.p_tracker_m = {10.0, 0.0, 0.0};
  s.has_environment = true;
  s.environment = weather(kUseStart, air_K);
  return s;
}

TEST(RawDistances, AreCorrectedToTheMeasuredAir) {
  EnvironmentUseOptions use;
  auto assumed = with_point(293.15);
  use.air.assumed_index = index_of_air(assumed.environment, use.air)->n;
  correct_for_air(assumed, use);
  EXPECT_DOUBLE_EQ(assumed.tracker_point.p_tracker_m[0], 10.0);
  auto warm = with_point(298.15);
  correct_for_air(warm, use);
  EXPECT_NEAR(warm.tracker_point.p_tracker_m[0] - 10.0, 10.0 * 5 * 0.94e-6,
              1e-6);  // thinner: farther
}

TEST(RawDistances, AreNotUsedWithoutTheAir) {
  EnvironmentUseOptions use;
  use.air.assumed_index = 1.00027;
  auto s = with_point(std::nan(""));
  correct_for_air(s, use);
  EXPECT_TRUE(has(s.tracker_point.head.flags, SampleFlag::PointInvalid));
}

TEST(RawDistances, TheTrackersOwnScaleAddsToThatOfTheAir) {
  EnvironmentUseOptions use;
  use.tracker_u_scale = 0.3e-6;
  const auto s = with_point(293.15);
  EXPECT_DOUBLE_EQ(effect_of(s, use)->u_scale, 0.3e-6);
  use.air.assumed_index = 1.00027;
  const auto index = *index_of_air(s.environment, use.air);
  EXPECT_DOUBLE_EQ(effect_of(s, use)->u_scale, std::hypot(0.3e-6, index.u_n / index.n));
}

TEST(RawDistances, AreLeftAloneUnlessConfigured) {
  auto s = with_point(303.15);
  correct_for_air(s, {});
  EXPECT_EQ(s.tracker_point.p_tracker_m[0], 10.0);
}

TEST(LiveView, ShowsCorrectedPositionsAndTheNewestTemperatures) {
  const drivers::MonotonicTime time;
  LiveView view{AssemblerOptions{.environment = with_scale()}, time};
  auto batch = measured({scale_at(kUseStart, 296.15)});
  protocol::AxisSample axes;
  axes.head.time = kUseStart;
  axes.axis_count = 3;
  axes.position = {1.1, 0.0, 0.0};
  batch.axes = {axes};
  EXPECT_TRUE(view.take(batch));
  EXPECT_EQ(view.view().environment.temperature_K[2], 296.15);
  EXPECT_NEAR(view.view().position[0] - 1.1, 24e-6, 1e-12);
}

TEST(LiveView, ShowsNoAxesWithoutTheTemperatureOfTheirScale) {
  const drivers::MonotonicTime time;
  LiveView view{AssemblerOptions{.environment = with_scale()}, time};
  Batch batch;
  protocol::AxisSample axes;
  axes.head.time = kUseStart;
  axes.axis_count = 3;
  batch.axes = {axes};
  view.take(batch);
  EXPECT_FALSE(axes_known(view.view()));
  EXPECT_FALSE(view.axes_known_at());
}

}  // namespace
}  // namespace abbe::daemon
