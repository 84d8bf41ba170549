// [tracker] with protocol = "lines".
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "abbe/config/capabilities.hpp"
#include "abbe/devices/tracker_options.hpp"
#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using Column = protocol::lines::Column;

const std::string kLines = R"([tracker]
protocol = "lines"
transport = "tcp"
host = "10.0.0.7"
port = 7001
columns = ["time", "x", "y", "z", "status"]
valid_status = ["0", "OK"]
length_unit = "mm"
point_rate_hz = 250
weather = "compute"
)";

std::string with_line(std::string text, const std::string& key, const std::string& line) {
  const auto at = text.find(key + " = ");
  text.replace(at, text.find('\n', at) + 1 - at, line);
  return kMachine + text;
}

/// The faults of kLines with another line for `key`.
std::vector<std::string> faults_with(const std::string& key, const std::string& line) {
  return faults_of(with_line(kLines, key, line));
}

TEST(ConfigLines, BecomeOptionsOfTheDriver) {
  const auto config = parse_config(kMachine + kLines, "abbed.toml");
  ASSERT_TRUE(config) << testing::PrintToString(config.error().details);
  const auto options = line_options(*config->of<TrackerConfig>(), 1.0);
  EXPECT_EQ(drivers::text_of(options.address), "10.0.0.7:7001");
  EXPECT_EQ(options.receiver.format.column_count, 5u);
  EXPECT_EQ(options.receiver.format.columns[4], Column::Status);
  EXPECT_EQ(options.receiver.format.valid_status[1].text(), "OK");
  EXPECT_EQ(options.receiver.time_separation, std::chrono::milliseconds{4});
  EXPECT_EQ(tracker_source(*config)->point_rate_hz, 250.0);
}

TEST(ConfigLines, AreReceivedOverEveryTransport) {
  const auto address = [](const std::string& lines) {
    const auto config = parse_config(with_line(kLines, "transport", lines), "abbed.toml");
    EXPECT_TRUE(config) << testing::PrintToString(config.error().details);
    return config ? drivers::text_of(config->of<TrackerConfig>()->lines->address) : "";
  };
  EXPECT_EQ(address("transport = \"udp\"\n"), "10.0.0.7:7001 (UDP)");
  EXPECT_EQ(address("transport = \"tcp-server\"\n"), "10.0.0.7:7001 (TCP server)");
  EXPECT_THAT(faults_with("transport", "transport = \"serial\"\nserial = \"/dev/ttyUSB0\"\n"),
              Contains(HasSubstr("has no meaning with transport = \"serial\"")));
}

TEST(ConfigLines, ReportFaultsWithFileAndLine) {
  EXPECT_THAT(faults_with("columns", "columns = [\"time\", \"x\", \"y\", \"q\"]\n"),
              Contains(AllOf(HasSubstr("abbed.toml:"), HasSubstr("\"q\""))));
  EXPECT_THAT(faults_with("columns", ""), Contains(HasSubstr("columns")));
  EXPECT_THAT(faults_with("columns", "columns = [\"time\", \"x\", \"y\", \"status\"]\n"),
              Contains(HasSubstr("needs x, y, z")));
  EXPECT_THAT(faults_with("columns", "columns = [\"x\", \"y\", \"z\", \"status\"]\n"),
              Contains(HasSubstr("needs \"time\"")));
  EXPECT_THAT(faults_with("valid_status", ""), Contains(HasSubstr("valid_status")));
  EXPECT_THAT(faults_with("point_rate_hz", ""), Contains(HasSubstr("point_rate_hz")));
  EXPECT_THAT(faults_with("weather", ""), Contains(HasSubstr("weather")));
  EXPECT_THAT(faults_with("length_unit", ""), Contains(HasSubstr("length_unit")));
  EXPECT_THAT(faults_with("weather", "weather = \"none\"\nangle_unit = \"deg\"\n"),
              Contains(HasSubstr("no column has this unit")));
  EXPECT_THAT(faults_with("weather", "weather = \"none\"\nreflector = \"1.5\"\n"),
              Contains(HasSubstr("abbe sends nothing")));
}

TEST(ConfigLines, NeedAUnitOfAngles) {
  EXPECT_THAT(faults_with("columns",
                          "columns = [\"time\", \"range\", \"azimuth\", \"elevation\", "
                          "\"status\"]\n"),
              Contains(HasSubstr("angle_unit")));
}

TEST(ConfigLines, NeedNoTimeInStationaryMode) {
  const std::string stationary = "mode = \"stationary\"\nstationary_time_ms = 800\n";
  auto text = with_line(kLines, "point_rate_hz", stationary);
  text.replace(text.find("\"time\", "), 8, "");
  EXPECT_THAT(faults_of(text), IsEmpty());
}

TEST(ConfigLines, HaveKeysThatEmsconDoesNotHave) {
  EXPECT_THAT(faults_of(kMachine + "[tracker]\nhost = \"10.0.0.7\"\ncolumns = [\"x\"]\n"),
              Contains(HasSubstr("only with protocol = \"lines\"")));
}

}  // namespace
}  // namespace abbe::daemon
