#include "abbe/sim/line_tracker.hpp"

#include <gmock/gmock.h>

#include <sstream>
#include <string>
#include <vector>

#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using lines::Column;

lines::LineFormat format_of(std::initializer_list<Column> columns) {
  lines::LineFormat format;
  for (const Column column : columns) format.columns[format.column_count++] = column;
  format.valid_status[0] = lines::StatusWord::from("OK").value();
  format.valid_status_count = 1;
  return format;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) all.push_back(line);
  return all;
}

class LineTrackerOutput : public testing::Test {
 protected:
  /// What is printed in each millisecond of `duration`.
  std::vector<std::string> bursts_of(std::chrono::nanoseconds duration) {
    std::vector<std::string> bursts;
    for (const HostTime end = now_ + duration; now_ < end; now_ += 1ms) {
      tracker_.advance(now_);
      if (auto text = tracker_.take_output(); !text.empty()) bursts.push_back(std::move(text));
    }
    return bursts;
  }

  const VirtualMachine machine_ = test::standing_machine();
  HostTime now_{100s};
  LineTracker tracker_{
      {.format = format_of({Column::Time, Column::X, Column::Y, Column::Z, Column::Status})},
      machine_,
      now_};
};

TEST(PrintedLine, HasTheColumnsInTheirOrderAndUnits) {
  auto format = format_of({Column::Status, Column::Range, Column::Azimuth, Column::Zenith});
  format.separator = ';';
  format.decimal_sign = ',';
  format.metres_per_length = 1.0;
  const auto line = print_line(format, {0.0, 2.0, 0.0}, DeviceTime{1500ms}, true);
  EXPECT_EQ(line, "OK;2,0000000000;1,570796326795;1,570796326795\n");
}

TEST(PrintedLine, IsReadByTheDecoderToTheSamePoint) {
  const auto format = format_of({Column::Time, Column::X, Column::Y, Column::Z, Column::Status});
  const Eigen::Vector3d p{1.2345678901, -0.25, 0.125};
  auto line = print_line(format, p, DeviceTime{1502ms}, false);
  line.pop_back();
  const auto read = lines::decode(line, format);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->time, DeviceTime{1502ms});
  EXPECT_FALSE(read->valid);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(read->p_tracker_m[i], p[i], 1e-13);
}

TEST_F(LineTrackerOutput, IsEmptyWhileNobodyReceives) {
  EXPECT_THAT(bursts_of(2s), testing::IsEmpty());
}

TEST_F(LineTrackerOutput, ComesInBurstsOfTheUsualDuration) {
  tracker_.connected(now_);
  const auto bursts = bursts_of(10s);
  EXPECT_NEAR(static_cast<double>(bursts.size()), 10.0 / 0.332, 1.0);
  EXPECT_NEAR(static_cast<double>(split(bursts[5]).size()), 166.0, 8.0);  // 324 to 344 ms
}

/// A run through lines and one through emScon with the same seed have the same points.
TEST_F(LineTrackerOutput, HasThePointsOfTheOtherTracker) {
  tracker_.connected(now_);
  const auto text = bursts_of(1s).front();
  TrackerModel model;
  for (int n = 0; n < 10; ++n) {
    const auto read =
        lines::decode(split(text)[static_cast<std::size_t>(n)],
                      format_of({Column::Time, Column::X, Column::Y, Column::Z, Column::Status}));
    ASSERT_TRUE(read);
    const auto view = observe(model, machine_, host_time(model, HostTime{100s}, *read->time), n);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(read->p_tracker_m[i], view.p_tracker_m[i], 1e-12) << n;
  }
}

TEST_F(LineTrackerOutput, MarksPointsAfterAFaultInvalid) {
  tracker_.connected(now_);
  bursts_of(1s);
  tracker_.inject({.kind = FaultKind::SpeedExceeded, .duration_s = 0.1}, now_);
  std::string text;
  for (const auto& burst : bursts_of(1s)) text += burst;
  EXPECT_THAT(text, testing::HasSubstr(" bad\n"));
}

}  // namespace
}  // namespace abbe::sim
