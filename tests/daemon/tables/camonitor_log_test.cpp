/// Logs of camonitor as scale readings.
#include "abbe/tables/camonitor_log.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <string>

#include "abbe/base/text_file.hpp"
#include "faults_text.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const CamonitorOptions kAxisPvs{.pvs = {"ioc:X.RBV", "ioc:Y.RBV", "ioc:Z.RBV"},
                                .metres_per_value = 1e-3};

std::string log_line(std::string_view pv, double second, std::string_view value) {
  return fmt::format("{:<30} 2026-11-12 12:34:{:09.6f} {}  \n", pv, second, value);
}

/// Y and Z stand still; X as in `lines`.
std::string log_with(const std::string& lines) {
  return log_line("ioc:Z.RBV", 1.0, "-200.1234") + log_line("ioc:Y.RBV", 1.0, "50.12345") + lines;
}

Result<EncoderFile> readings_of(const std::string& lines) {
  return parse_camonitor_log(log_with(lines), "run.log", kAxisPvs);
}

std::string faults_of_log(const std::string& lines) {
  return test::faults_text(readings_of(lines));
}

double x_mm(const EncoderRow& row) {
  return 1e3 * row.reading_m[0];
}

TEST(CamonitorLog, GivesReadingsOfThreeAxes) {
  const auto text = read_text(std::string(ABBE_TEST_DATA) + "/programs/camonitor.log");
  ASSERT_TRUE(text);
  EXPECT_TRUE(is_camonitor_log(*text));
  EXPECT_THAT(pvs_of_log(*text, 3), ElementsAre("ioc:Z.RBV", "ioc:X.RBV", "ioc:Y.RBV"));
  const auto file = parse_camonitor_log(*text, "camonitor.log", kAxisPvs);
  ASSERT_TRUE(file) << test::faults_text(file);
  ASSERT_GT(file->rows.size(), 10u);
  EXPECT_EQ(file->rows.front().reading_m, (AxisPosition{0.0, 0.05, -0.2}));
  EXPECT_EQ(file->times.first_line, 3u);  // the first instant at which all axes have a value
  const auto& last = file->rows.back();
  EXPECT_DOUBLE_EQ(last.reading_m[0], 0.020);
  EXPECT_DOUBLE_EQ(last.reading_m[1], 0.065);
  EXPECT_NEAR(last.time_s, 2.9, 1e-6);
}

TEST(CamonitorLog, InterpolatesBetweenNeighbouringUpdates) {
  std::string lines;
  for (int i = 0; i < 5; ++i)
    lines += log_line("ioc:X.RBV", 2.0 + 0.1 * i, fmt::format("{:.4f}", 1.0 * i));
  lines += log_line("ioc:Y.RBV", 2.25, "50.12345");
  const auto file = readings_of(lines);
  ASSERT_TRUE(file) << test::faults_text(file);
  for (const auto& row : file->rows)
    if (std::abs(row.time_s - 0.25) < 1e-6) EXPECT_NEAR(x_mm(row), 2.5, 1e-9);
}

TEST(CamonitorLog, DoesNotInterpolateOverAStandstill) {
  std::string lines;
  for (int i = 0; i < 9; ++i)  // moves at 2.0 to 2.2 s and from 5.0 s on
    lines += log_line("ioc:X.RBV", (i < 3 ? 2.0 : 4.7) + 0.1 * i, fmt::format("{:.4f}", 1.0 * i));
  for (const double at_s : {3.0, 4.95}) lines += log_line("ioc:Y.RBV", at_s, "50.12345");
  const auto file = readings_of(lines);
  ASSERT_TRUE(file) << test::faults_text(file);
  bool stands = false;
  for (const auto& row : file->rows) {
    if (std::abs(row.time_s - 1.0) < 1e-6) stands = x_mm(row) == 2.0;
    EXPECT_GT(std::abs(row.time_s - 2.95), 1e-6) << "X may have begun to move";
  }
  EXPECT_TRUE(stands);
}

TEST(CamonitorLog, SkipsOtherPvsAndAlarmsOfTheSameValue) {
  const auto file = readings_of(
      log_line("ioc:X.RBV", 2.0, "1.0001") + log_line("ioc:X.RBV", 2.0, "1.0001 HIGH MINOR") +
      log_line("ioc:mode", 2.1, "Running") + "ioc:other *** Not connected (PV not found)\n");
  ASSERT_TRUE(file) << test::faults_text(file);
  EXPECT_EQ(file->rows.size(), 1u);
}

TEST(CamonitorLog, NamesLinesWithoutAReading) {
  const std::string good = log_line("ioc:X.RBV", 2.0, "1.0001");
  EXPECT_THAT(faults_of_log("ioc:X.RBV 2026-11-12 12:34:02.0 *** disconnected\n"),
              HasSubstr("run.log:3:33: ioc:X.RBV: not connected here"));
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 3.0, "nan")),
              HasSubstr("ioc:X.RBV: \"nan\": must be finite"));
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 3.0, "1,5")),
              HasSubstr("has a decimal comma"));
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 3.0, "0 UDF INVALID")),
              HasSubstr("the value is INVALID"));
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 3.0, "3 1.0 2.0 3.0")),
              HasSubstr("must be one value"));
  EXPECT_THAT(faults_of_log(""), HasSubstr("ioc:X.RBV: no value of X: is the name right?"));
}

TEST(CamonitorLog, NamesTimesThatCannotBeUsed) {
  const std::string good = log_line("ioc:X.RBV", 2.0, "1.0001");
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 1.0, "2.0001")),
              HasSubstr("run.log:4:32: ioc:X.RBV: the time goes back by 1 s from line 3"));
  EXPECT_THAT(faults_of_log(good + log_line("ioc:X.RBV", 2.0, "2.0001")),
              HasSubstr("another value at the time of line 3"));
  EXPECT_THAT(faults_of_log("ioc:X.RBV               +1.250000 1.0001\n"),
              HasSubstr("must be the name, a date, a time of the server"));
  EXPECT_THAT(faults_of_log("ioc:X.RBV (2026-11-12 12:34:02.0) 1.0001\n"),
              HasSubstr("without -t and -F"));
}

TEST(CamonitorLog, NamesValuesWithTooFewDigits) {
  EXPECT_THAT(faults_of_log(log_line("ioc:X.RBV", 2.0, "1234.56")),
              AllOf(HasSubstr("at most 6 digits, a step of 10 um"), HasSubstr("-f 6")));
  EXPECT_EQ(faults_of_log(log_line("ioc:X.RBV", 2.0, "234.567")), "");
}

TEST(CamonitorLog, NamesAFileThatIsNone) {
  EXPECT_THAT(test::faults_text(parse_camonitor_log("", "run.log", kAxisPvs)),
              HasSubstr("the file is empty"));
  EXPECT_THAT(faults_of_log("ioc:X.RBV 2026-11-12 12:34:02.0 1.00"),
              HasSubstr("does not end with a newline"));
  EXPECT_THAT(faults_of_log(std::string("\0\n", 2)), HasSubstr("not a text file"));
  EXPECT_FALSE(is_camonitor_log("time_s,x_mm,y_mm,z_mm\n"));
  EXPECT_TRUE(is_camonitor_log("ioc:X.RBV    *** Not connected (PV not found)\n"));
}

}  // namespace
}  // namespace abbe::daemon
