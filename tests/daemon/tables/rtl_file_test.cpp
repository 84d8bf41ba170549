/// .rtl files of a laser interferometer.
#include "abbe/tables/rtl_file.hpp"

#include <gmock/gmock.h>

#include <string>

#include "abbe/base/text_file.hpp"
#include "faults_text.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const RtlOptions kRtlX{.error = "EXX", .line_m = {0.0, 0.05, -0.2}, .metres_per_deviation = 1e-6};

/// Two targets, and run 1 there, run 2 back. Changed by the tests.
const std::string kRtlHead = "HEADER::\nFile type  : rtl\n\nTARGET DATA::\nTarget-count: 2\n";
const std::string kRtlRuns = "RUNS::\nRun-count:2\nDEVIATIONS::\nRun Target Data:\n";
const std::string kShortRtl = kRtlHead + "Targets :\n0.0 100.0\nFlags: 0 0 2 0\n" + kRtlRuns +
                              "1 1 0.0\n1 2 1.5\n2 2 1.9\n2 1 0.4\nEOF::\n";

std::string faults_of_rtl(const std::string& text) {
  return test::faults_text(parse_rtl(text, "m.rtl", kRtlX));
}

std::string rtl_with(std::string from, const std::string& to) {
  std::string text = kShortRtl;
  text.replace(text.find(from), from.size(), to);
  return text;
}

TEST(RtlFile, GivesRunsInBothDirections) {
  const auto text = read_text(std::string(ABBE_TEST_DATA) + "/programs/example.rtl");
  ASSERT_TRUE(text);
  EXPECT_TRUE(is_rtl(*text));
  const auto file = parse_rtl(*text, "example.rtl", kRtlX);
  ASSERT_TRUE(file) << test::faults_text(file);
  ASSERT_THAT(file->errors, SizeIs(1));
  const auto& error = file->errors[0];
  EXPECT_EQ(error.name, "EXX");
  EXPECT_EQ(error.line_m, calib::Vector3(0.0, 0.05, -0.2));
  ASSERT_THAT(error.readings, SizeIs(24));
  EXPECT_EQ(error.readings[5].position_m, 0.45);
  EXPECT_TRUE(error.readings[5].forward);
  EXPECT_EQ(error.readings[6].position_m, 0.45);
  EXPECT_FALSE(error.readings[6].forward);
  EXPECT_EQ(error.readings[6].run, 1);
  EXPECT_EQ(error.readings[23].run, 2);
  const auto runs = calib::direct::runs_of(error);
  ASSERT_TRUE(runs) << runs.error().text;
  EXPECT_THAT(runs->positions_m, SizeIs(6));
  EXPECT_THAT(runs->reversal, SizeIs(2));
}

TEST(RtlFile, ReadsValuesInTheStatedUnitWithTheirLines) {
  auto options = kRtlX;
  options.metres_per_deviation = 1e-3;
  const auto file = parse_rtl(kShortRtl, "m.rtl", options);
  ASSERT_TRUE(file) << test::faults_text(file);
  EXPECT_DOUBLE_EQ(file->errors[0].readings[1].value, 1.5e-3);
  EXPECT_EQ(file->lines[0][1], 14u);
}

TEST(RtlFile, TakesTargetsThatDescend) {
  const auto file = parse_rtl(rtl_with("0.0 100.0\n", "100.0\n0.0\n"), "m.rtl", kRtlX);
  ASSERT_TRUE(file) << test::faults_text(file);
  EXPECT_FALSE(file->errors[0].readings[0].forward);
}

TEST(RtlFile, SkipsSectionsThatAreNotNeededAlsoInAnotherEncoding) {
  EXPECT_EQ(faults_of_rtl(rtl_with("RUNS::", "USER-TEXT::\nMachine: M\xfchle\n\nRUNS::")), "");
  EXPECT_EQ(faults_of_rtl(rtl_with("EOF::", "EQUIPMENT::\nLaser: 1 2 3\n\nEOF::")), "");
  EXPECT_EQ(faults_of_rtl("\xEF\xBB\xBF" + kShortRtl), "");
}

TEST(RtlFile, NamesAMissingOrRepeatedSection) {
  EXPECT_THAT(faults_of_rtl(kRtlHead + "Targets :\n0 1\n"),
              AllOf(HasSubstr("m.rtl:7:1: RUNS: the section is missing"),
                    HasSubstr("DEVIATIONS: the section is missing")));
  EXPECT_THAT(faults_of_rtl(kShortRtl + kShortRtl),
              HasSubstr("m.rtl:18:1: HEADER: the section is also in line 1"));
  EXPECT_THAT(faults_of_rtl(rtl_with(": rtl", ": rta")),
              HasSubstr("m.rtl:2:14: File type: \"rta\""));
  EXPECT_THAT(faults_of_rtl(rtl_with("File type  : rtl\n", "")), HasSubstr("File type: missing"));
}

TEST(RtlFile, NamesAFileThatIsCutOff) {
  EXPECT_THAT(faults_of_rtl(rtl_with("2 1 0.4\nEOF::\n", "")),
              HasSubstr("m.rtl:15:1: run: run 2 has 1 of 2 targets: the file may be cut off"));
  EXPECT_THAT(faults_of_rtl(rtl_with("2 2 1.9\n2 1 0.4\nEOF::\n", "")),
              HasSubstr("m.rtl:10:1: Run-count: 2, but the deviations are of 1 runs"));
  EXPECT_THAT(faults_of_rtl(rtl_with("2 1 0.4\nEOF::\n", "2 1")),
              HasSubstr("m.rtl:16:1: Run Target Data: 2 values, expected run, target"));
  EXPECT_THAT(faults_of_rtl(rtl_with("100.0", "")),
              HasSubstr("m.rtl:14:3: target: 2: must be a whole number, 1 to 1"));
}

TEST(RtlFile, NamesNumbersThatAreNone) {
  EXPECT_THAT(faults_of_rtl(rtl_with("1 2 1.5", "1 2 nan")),
              HasSubstr("m.rtl:14:5: deviation: \"nan\": must be finite"));
  EXPECT_THAT(faults_of_rtl(rtl_with("1 2 1.5", "1 2 1,5")), HasSubstr("has a decimal comma"));
  EXPECT_THAT(faults_of_rtl(rtl_with("0.0 100.0", "0.0 1e999")), HasSubstr("Targets"));
  EXPECT_THAT(faults_of_rtl(rtl_with("Run-count:2", "Run-count:-2")), HasSubstr("Run-count: -2"));
  EXPECT_THAT(faults_of_rtl(std::string("HEADER::\n\0\n", 11)), HasSubstr("not a text file"));
  EXPECT_THAT(faults_of_rtl(""), HasSubstr("the file is empty"));
}

TEST(RtlFile, NamesRunsThatCannotBeUsed) {
  EXPECT_THAT(faults_of_rtl(rtl_with("2 1 0.4", "2 2 0.4")),
              HasSubstr("m.rtl:16:1: target: run 2 has target 2 also in line 15"));
  const std::string three = rtl_with("Target-count: 2", "Target-count: 3");
  auto turning = three;
  turning.replace(turning.find("0.0 100.0"), 9, "0 100 200");
  turning.replace(turning.find("2 2 1.9\n2 1 0.4"), 15, "1 3 0\n2 2 1\n2 3 2\n2 1 0");
  EXPECT_THAT(faults_of_rtl(turning),
              HasSubstr("m.rtl:18:1: target: run 2 turns here, from 200 to 0 mm"));
  auto unequal = rtl_with("Run-count:2", "Run-count:3");
  unequal.replace(unequal.find("EOF::"), 5, "3 1 0.1\n3 2 1.4\nEOF::");
  EXPECT_THAT(faults_of_rtl(unequal),
              HasSubstr("2 runs are towards larger positions, 1 towards smaller ones"));
}

TEST(RtlFile, IsRecognisedByItsFirstSection) {
  EXPECT_TRUE(is_rtl("\r\nHEADER::\r\n"));
  EXPECT_FALSE(is_rtl("name,position_mm\n"));
  EXPECT_FALSE(is_rtl(""));
}

}  // namespace
}  // namespace abbe::daemon
