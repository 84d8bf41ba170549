#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/protocol/lines/line_framer.hpp"
#include "abbe/protocol/lines/tracker_line.hpp"

namespace abbe::protocol::lines {
namespace {

using enum Column;
using What = LineFault::What;

LineFormat format_of(std::initializer_list<Column> columns) {
  LineFormat format;
  for (const Column column : columns) format.columns[format.column_count++] = column;
  return format;
}

LineFormat with_status(LineFormat format, std::initializer_list<std::string_view> valid) {
  for (const auto word : valid)
    format.valid_status[format.valid_status_count++] = StatusWord::from(word).value();
  return format;
}

std::vector<std::string> lines_of(LineFramer& framer, std::string_view bytes) {
  framer.push(std::as_bytes(std::span{bytes}));
  std::vector<std::string> all;
  while (const auto line = framer.next()) all.emplace_back(line->text);
  return all;
}
using Texts = std::vector<std::string>;

/// The fault of a line, or nullopt.
std::optional<LineFault> fault_of(std::string_view line, const LineFormat& format) {
  const auto decoded = decode(line, format);
  return decoded ? std::nullopt : std::optional{decoded.error()};
}

void expect_fault(std::string_view line, const LineFormat& format, What what, int column) {
  const auto fault = fault_of(line, format);
  ASSERT_TRUE(fault) << line;
  EXPECT_EQ(fault->what, what) << line << ": " << text_of(fault->what);
  EXPECT_EQ(fault->column, column) << line;
}

TEST(LineFramer, GivesLinesWhateverEndsThem) {
  LineFramer framer;
  EXPECT_EQ(lines_of(framer, "a\nb\r\nc\rd\n\n\ne"), (Texts{"a", "b", "c", "d"}));
  EXPECT_EQ(lines_of(framer, "f\n"), (Texts{"ef"}));
}

TEST(LineFramer, JoinsALineThatComesInParts) {
  LineFramer framer;
  EXPECT_EQ(lines_of(framer, "1.0 2"), Texts{});
  EXPECT_EQ(lines_of(framer, ".0 3.0\r"), (Texts{"1.0 2.0 3.0"}));
  EXPECT_EQ(lines_of(framer, "\n4"), Texts{});
}

TEST(LineFramer, ReportsATooLongLineOnceAndContinuesAfterIt) {
  LineFramer framer;
  const std::string bytes =
      std::string(kMaxLine + 1, '1') + "\n" + std::string(kMaxLine, '2') + "\n";
  framer.push(std::as_bytes(std::span{bytes}));
  const auto longer = framer.next();
  ASSERT_TRUE(longer);
  EXPECT_TRUE(longer->too_long);
  const auto longest = framer.next();
  ASSERT_TRUE(longest);
  EXPECT_FALSE(longest->too_long);
  EXPECT_EQ(longest->text, std::string(kMaxLine, '2'));
}

TEST(LineFramer, DiscardsTheRestOfALineAfterResync) {
  LineFramer framer;
  framer.resync();
  EXPECT_EQ(lines_of(framer, "23 4.5\n6 7 8\n"), (Texts{"6 7 8"}));
}

TEST(LineFramer, EndsALineWithTheDatagram) {
  LineFramer framer;
  EXPECT_EQ(lines_of(framer, "1 2 3\n4 5 6"), (Texts{"1 2 3"}));
  EXPECT_EQ(framer.take_incomplete()->text, "4 5 6");
  EXPECT_FALSE(framer.take_incomplete());
}

TEST(TrackerLine, ReadsColumnsInAnyOrder) {
  const auto format = with_status(format_of({Status, Z, Ignored, Time, X, Y}), {"OK"});
  const auto line = decode("OK 3 note 12.5 1000 -2.5e1", format);
  ASSERT_TRUE(line);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[0], 1.0);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[1], -0.025);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[2], 0.003);
  EXPECT_EQ(line->time->time_since_epoch(), std::chrono::milliseconds{12'500});
  EXPECT_TRUE(line->valid);
}

TEST(TrackerLine, ConvertsSphericalCoordinates) {
  auto format = format_of({Range, Azimuth, Elevation});
  format.metres_per_length = 1.0;
  format.radians_per_angle = std::numbers::pi / 180.0;
  const auto line = decode("2 90 30", format);
  ASSERT_TRUE(line);
  constexpr double kRounding_m = 1e-15;
  EXPECT_NEAR(line->p_tracker_m[0], 0.0, kRounding_m);
  EXPECT_NEAR(line->p_tracker_m[1], std::sqrt(3.0), kRounding_m);
  EXPECT_NEAR(line->p_tracker_m[2], 1.0, kRounding_m);

  format.columns[2] = Zenith;  // 60 degrees from the zenith are 30 above the horizon
  EXPECT_NEAR(decode("2 90 60", format)->p_tracker_m[2], 1.0, kRounding_m);
}

TEST(TrackerLine, TakesSeparatorAndDecimalSignAsConfigured) {
  auto format = format_of({X, Y, Z});
  EXPECT_TRUE(decode("  1\t2   3 ", format));
  format.separator = ';';
  format.decimal_sign = ',';
  const auto line = decode("1,5; -2,5 ;3;", format);
  ASSERT_TRUE(line);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[0], 1.5e-3);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[1], -2.5e-3);
  expect_fault("1.234,5;2;3", format, What::NotANumber, 1);
  expect_fault("1;;3", format, What::NotANumber, 2);
}

TEST(TrackerLine, HasAnEmptyColumnBetweenTwoTabsThatSeparate) {
  auto format = format_of({X, Ignored, Y, Z});
  format.separator = '\t';
  const auto line = decode("1\t\t 2 \t3", format);
  ASSERT_TRUE(line);
  EXPECT_DOUBLE_EQ(line->p_tracker_m[1], 2e-3);
  expect_fault("\t1\t2\t3", format, What::NotANumber, 1);
}

TEST(TrackerLine, KeepsTheTimeToTheNanosecond) {
  auto format = format_of({Time, X, Y, Z});
  const auto ns_of = [&](std::string_view time) {
    const auto line = decode(std::string{time} + " 1 2 3", format);
    return line ? line->time->time_since_epoch().count() : -1;
  };
  EXPECT_EQ(ns_of("1764571234.502000001"), 1'764'571'234'502'000'001);
  EXPECT_EQ(ns_of("7"), 7'000'000'000);
  EXPECT_EQ(ns_of("0.0000000019"), 1);
  format.time_unit = TimeUnit::Milliseconds;
  EXPECT_EQ(ns_of("7.25"), 7'250'000);
  format.time_unit = TimeUnit::Nanoseconds;
  EXPECT_EQ(ns_of("1764571234502000001"), 1'764'571'234'502'000'001);
}

TEST(TrackerLine, RefusesTimesThatAreNone) {
  const auto format = format_of({X, Y, Z, Time});
  expect_fault("1 2 3 12:30:01.5", format, What::NotANumber, 4);
  expect_fault("1 2 3 .", format, What::NotANumber, 4);
  expect_fault("1 2 3 99999999999", format, What::OutOfRange, 4);
}

TEST(TrackerLine, JudgesAPointByItsStatus) {
  const auto format = with_status(format_of({X, Y, Z, Status}), {"0", "OK"});
  EXPECT_TRUE(decode("1 2 3 0", format)->valid);
  EXPECT_TRUE(decode("1 2 3 OK", format)->valid);
  const auto other = decode("1 2 3 17", format);
  ASSERT_TRUE(other);
  EXPECT_FALSE(other->valid);
  EXPECT_EQ(other->status, 17);
  EXPECT_FALSE(decode("1 2 3 ok", format)->valid);
}

TEST(TrackerLine, NamesTheColumnThatCannotBeRead) {
  const auto format = format_of({Time, X, Y, Z});
  expect_fault("1 2 abc 4", format, What::NotANumber, 3);
  expect_fault("1 2 3", format, What::MissingColumn, 4);
  expect_fault("1 2 3 4 5", format, What::TooManyColumns, 5);
  expect_fault("1 2 nan 4", format, What::NotANumber, 3);
  expect_fault("1 2 inf 4", format, What::NotANumber, 3);
  expect_fault("1 2 0x10 4", format, What::NotANumber, 3);
  expect_fault("1 2 1,5 4", format, What::NotANumber, 3);
  expect_fault("1 2 1000001 4", format, What::OutOfRange, 3);  // more than 1000 m in mm
}

TEST(TrackerLine, RefusesAnglesThatAreNone) {
  const auto format = format_of({Range, Azimuth, Elevation});  // rad
  expect_fault("1000 45 0.1", format, What::OutOfRange, 2);
  expect_fault("1000 1 2", format, What::OutOfRange, 3);
  expect_fault("-1 1 1", format, What::OutOfRange, 1);
}

TEST(TrackerLine, KnowsHeadingsAndComments) {
  EXPECT_TRUE(is_comment("# 17 points"));
  EXPECT_TRUE(is_comment("   "));
  EXPECT_FALSE(is_comment("1 2 3"));
  EXPECT_TRUE(is_heading("X Y Z Time"));
  EXPECT_FALSE(is_heading("X1 2 3"));
}

TEST(LineFormat, NamesWhatItMisses) {
  EXPECT_EQ(format_fault(format_of({X, Y, Z})), "");
  EXPECT_EQ(format_fault(format_of({Time, Range, Azimuth, Zenith, Ignored, Ignored})), "");
  EXPECT_NE(format_fault(format_of({X, Y})), "");
  EXPECT_NE(format_fault(format_of({X, Y, Z, X})), "");
  EXPECT_NE(format_fault(format_of({X, Y, Z, Range})), "");
  EXPECT_NE(format_fault(format_of({Range, Azimuth, Elevation, Zenith})), "");
  auto format = format_of({X, Y, Z});
  format.separator = format.decimal_sign = ',';
  EXPECT_NE(format_fault(format), "");
}

}  // namespace
}  // namespace abbe::protocol::lines
