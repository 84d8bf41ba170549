#include "abbe/config/capabilities.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "abbe/config/config.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

TEST(Capabilities, NameTheTablesOfTheirKinds) {
  EXPECT_EQ(tables_with(Capability::TrackerPoints), "[tracker]");
  EXPECT_EQ(tables_with(Capability::Axes), "[encoder], [counter_card], [axis_lines] or [cmm]");
  EXPECT_EQ(tables_with(Capability::NamedAxes, "nor"),
            "[encoder], [counter_card] nor [axis_lines]");
  EXPECT_EQ(tables_with(Capability::CountedAxes), "[counter_card]");
  EXPECT_EQ(tables_with(Capability::Marks), "[reference]");
  EXPECT_EQ(tables_with(Capability::Touches, "nor"), "[probe] nor [cmm]");
  EXPECT_EQ(tables_with(Capability::Motion), "[cmm]");
  EXPECT_EQ(tables_with(Capability::Environment), "[[environment]]");
}

TEST(Capabilities, AreNoneWithoutDevices) {
  const Config config;
  EXPECT_FALSE(tracker_source(config));
  EXPECT_FALSE(touch_source(config));
  EXPECT_FALSE(counted_axes(config));
  EXPECT_EQ(reference_marks(config), nullptr);
  EXPECT_FALSE(time_of_axis_samples(config, 1.0));
  EXPECT_EQ(measured_environment(config), 0);
}

TEST(Capabilities, OfATrackerInStationaryModeHaveItsAveragingTime) {
  Config config;
  auto& tracker = config.of<TrackerConfig>().emplace();
  EXPECT_FALSE(tracker_source(config)->stationary_time);

  tracker.mode = TrackerModeConfig::Stationary;
  tracker.stationary_time = 700ms;
  EXPECT_EQ(tracker_source(config)->stationary_time, 700ms);
}

TEST(Capabilities, OfATrackerNameTheSettingOfItsAir) {
  Config config;
  config.of<TrackerConfig>().emplace().weather = WeatherConfig::Read;
  EXPECT_EQ(tracker_source(config)->air, TrackerSource::Air::LastSet);
  EXPECT_EQ(tracker_source(config)->air_setting, "tracker.weather = \"read\"");
}

TEST(Capabilities, OfAMeasuringMachineAreTouchesWithPositions) {
  Config config;
  config.of<CmmConfig>().emplace().name = "bridge";
  EXPECT_EQ(touch_source(config)->device, "bridge");
  EXPECT_TRUE(touch_source(config)->reports_positions);
  EXPECT_TRUE(touch_source(config)->compensated);
}

TEST(Capabilities, OfAProbeAreTouchesWithAxisReadings) {
  Config config;
  config.of<ProbeConfig>().emplace();
  EXPECT_EQ(touch_source(config)->key, "probe");
  EXPECT_FALSE(touch_source(config)->reports_positions);
}

TEST(Capabilities, OfACardAreItsCountedAxes) {
  Config config;
  auto& counter = config.of<CounterCardConfig>().emplace();
  counter.card.wiring.axes = {{.name = "X", .channel = 0, .scale = 1e-8}};
  counter.zero_is_here = true;
  ASSERT_EQ(counted_axes(config)->axes().size(), 1u);
  EXPECT_EQ(counted_axes(config)->axes()[0].name, "X");
  EXPECT_TRUE(counted_axes(config)->zero_is_here);
}

TEST(Capabilities, OfAnEncoderAreItsSamplePeriods) {
  Config config;
  config.of<EncoderConfig>().emplace().sync_period = 2ms;
  EXPECT_EQ(time_of_axis_samples(config, 2.5), 5ms);
}

TEST(Capabilities, AMeasuringMachineReadsTheAxesOnlyIfNoOtherDeviceDoes) {
  Config config;
  config.of<CmmConfig>().emplace();
  EXPECT_TRUE(cmm_reads_axes(config));
  EXPECT_TRUE(config.axes_compensated());

  config.of<EncoderConfig>().emplace();
  EXPECT_FALSE(cmm_reads_axes(config));
  EXPECT_FALSE(config.axes_compensated());
}

}  // namespace
}  // namespace abbe::daemon
