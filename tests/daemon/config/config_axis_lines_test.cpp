// [axis_lines].
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "abbe/config/capabilities.hpp"
#include "abbe/devices/axis_lines_options.hpp"
#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kAxisLines = R"([axis_lines]
transport = "tcp"
host = "10.0.0.7"
port = 7002
columns = ["time", "Z", "X", "-", "Y", "status"]
valid_status = ["0", "OK"]
length_unit = "um"
sample_rate_hz = 250
axes = [{ axis = "Z", offset_mm = 2, invert = true }]
)";

/// kAxisLines with another line for `key`.
std::string axis_lines_with(const std::string& key, const std::string& line) {
  std::string text = kAxisLines;
  const auto at = text.find("\n" + key + " = ") + 1;
  text.replace(at, text.find('\n', at) + 1 - at, line);
  return kMachine + text;
}
std::vector<std::string> axis_faults_with(const std::string& key, const std::string& line) {
  return faults_of(axis_lines_with(key, line));
}

TEST(ConfigAxisLines, BecomeOptionsOfTheDriver) {
  const auto config = parse_config(kMachine + kAxisLines, "abbed.toml");
  ASSERT_TRUE(config) << testing::PrintToString(config.error().details);
  const auto options = line_options(*config->of<AxisLinesConfig>(), 1.0);
  EXPECT_EQ(drivers::text_of(options.address), "10.0.0.7:7002");
  EXPECT_EQ(options.receiver.time_separation, std::chrono::milliseconds{4});
  EXPECT_EQ(options.receiver.clock.max_constant_delay, std::chrono::milliseconds{2});

  const auto line = protocol::lines::decode("0.5 1000 2000 N7 3000 OK", options.receiver.format);
  ASSERT_TRUE(line);
  EXPECT_DOUBLE_EQ(line->value[0], 2e-3);         // X
  EXPECT_DOUBLE_EQ(line->value[1], 3e-3);         // Y
  EXPECT_DOUBLE_EQ(line->value[2], 2e-3 - 1e-3);  // Z, inverted
  EXPECT_TRUE(line->valid);
}

TEST(ConfigAxisLines, ReadTheAxesInTheOrderOfTheMachine) {
  const auto config = parse_config(kMachine + kAxisLines, "abbed.toml");
  ASSERT_TRUE(config);
  EXPECT_THAT(config->connected_axes(), ElementsAre("X", "Y", "Z"));
  EXPECT_EQ(time_of_axis_samples(*config, 2.5), std::chrono::milliseconds{10});
  EXPECT_FALSE(counted_axes(*config));
}

TEST(ConfigAxisLines, NeedTheLatencyWhereNoColumnIsTheTime) {
  const std::string alone = "columns = [\"X\", \"Y\", \"Z\", \"status\"]\n";
  EXPECT_THAT(axis_faults_with("columns", alone),
              Contains(AllOf(HasSubstr("abbed.toml:"), HasSubstr("latency_ms"))));
  const auto config =
      parse_config(axis_lines_with("columns", alone + "latency_ms = 6\n"), "abbed.toml");
  ASSERT_TRUE(config) << testing::PrintToString(config.error().details);
  const auto options = line_options(*config->of<AxisLinesConfig>(), 1.0);
  EXPECT_EQ(options.receiver.clock.max_constant_delay, std::chrono::milliseconds{6});
  EXPECT_EQ(time_of_axis_samples(*config, 2.5), std::chrono::milliseconds{16});
  EXPECT_THAT(axis_faults_with("sample_rate_hz", "sample_rate_hz = 250\nlatency_ms = 6\n"),
              Contains(HasSubstr("a column is \"time\"")));
}

TEST(ConfigAxisLines, ReportFaultsWithFileAndLine) {
  EXPECT_THAT(axis_faults_with("columns", "columns = [\"time\", \"X\", \"Y\", \"Q\"]\n"),
              Contains(AllOf(HasSubstr("abbed.toml:"), HasSubstr("\"Q\" must be an axis"))));
  EXPECT_THAT(axis_faults_with("columns", "columns = [\"time\", \"X\", \"Z\", \"status\"]\n"),
              Contains(HasSubstr("axis Y has no column")));
  EXPECT_THAT(
      axis_faults_with("columns", "columns = [\"time\", \"X\", \"Y\", \"Z\", \"X\", \"status\"]\n"),
      Contains(HasSubstr("axis X has two columns")));
  EXPECT_THAT(axis_faults_with("columns", ""), Contains(HasSubstr("columns")));
  EXPECT_THAT(axis_faults_with("valid_status", ""), Contains(HasSubstr("valid_status")));
  EXPECT_THAT(axis_faults_with("length_unit", ""), Contains(HasSubstr("length_unit")));
  EXPECT_THAT(axis_faults_with("length_unit", "length_unit = \"mm\"\nangle_unit = \"deg\"\n"),
              Contains(HasSubstr("no column is a rotary axis")));
  EXPECT_THAT(axis_faults_with("sample_rate_hz", ""), Contains(HasSubstr("sample_rate_hz")));
  EXPECT_THAT(axis_faults_with("axes", "axes = [{ axis = \"B\" }]\n"),
              Contains(HasSubstr("has no column")));
}

TEST(ConfigAxisLines, ExcludeEncodersOfTheSameAxes) {
  EXPECT_THAT(faults_of(kMachine + kCanBus + kNodes + kAxisLines),
              Contains(HasSubstr("axis X is claimed by [encoder] and [axis_lines]")));
}

TEST(ConfigAxisLines, AreReceivedOverASerialLine) {
  const std::string serial = "transport = \"serial\"\nserial = \"/dev/ttyUSB0\"\n";
  auto text = axis_lines_with("transport", serial);
  text.erase(text.find("host = "), text.find("columns = ") - text.find("host = "));
  EXPECT_THAT(faults_of(text), IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
