/// Points that SpatialAnalyzer, PolyWorks and others exported.
#include "abbe/tables/point_export.hpp"

#include <gmock/gmock.h>

#include <string>

#include "abbe/base/text_file.hpp"
#include "faults_text.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;

Result<PointExport> exported(const std::string& text, std::string_view unit = "mm") {
  return parse_point_export(text, "points.txt", unit);
}

std::string faults_of_points(const std::string& text, std::string_view unit = "mm") {
  return test::faults_text(exported(text, unit));
}

std::string example_of(const std::string& name) {
  return *read_text(std::string(ABBE_TEST_DATA) + "/programs/" + name);
}

TEST(PointExport, ReadsSpatialAnalyzer) {
  const std::string text = example_of("spatialanalyzer.txt");
  EXPECT_TRUE(is_point_export(text));
  EXPECT_EQ(point_export_header(text).unit, "mm");
  const auto file = exported(text);
  ASSERT_TRUE(file) << test::faults_text(file);
  EXPECT_EQ(file->frame, "A::Station 1");
  ASSERT_THAT(file->points, SizeIs(4));
  EXPECT_EQ(file->points[3].group, "A::shots 2");
  EXPECT_EQ(file->points[3].name, "corner 1");
  EXPECT_NEAR((file->points[3].p_m - calib::Vector3(0.549985, 0.470013, 0.049996)).norm(), 0.0,
              1e-12);
  EXPECT_EQ(file->points[3].line, 9u);
}

TEST(PointExport, ReadsTargetsWithTimesInBothSeparators) {
  const auto commas = exported("7,  1.5,  -2.25,  3,  05/28/19 18:01:15.250\n");
  ASSERT_TRUE(commas) << test::faults_text(commas);
  EXPECT_EQ(commas->points[0].name, "7");
  const auto blanks = exported("7  1.5  -2.25  3  05/28/19 18:01:16\n");
  ASSERT_TRUE(blanks) << test::faults_text(blanks);
  EXPECT_EQ(*blanks->points[0].time_s - *commas->points[0].time_s, 0.75);
}

TEST(PointExport, ReadsPolyWorksAndHeadings) {
  const auto section = exported(example_of("polyworks.txt"));
  ASSERT_TRUE(section) << test::faults_text(section);
  ASSERT_THAT(section->points, SizeIs(3));
  EXPECT_LT((section->points[0].p_m - calib::Vector3(0.0015, 0.00225, -0.003125)).norm(), 1e-15);

  const auto table = exported("\xEF\xBB\xBFName;X [m];Y [m];Z [m];Dev\r\nP 1;1;2;3;0.1\r\n", "m");
  ASSERT_TRUE(table) << test::faults_text(table);
  EXPECT_EQ(table->points[0].name, "P 1");
  EXPECT_EQ(table->points[0].p_m, calib::Vector3(1, 2, 3));
  const auto tabs = exported("Name\tTime (s)\tX\tY\tZ\nA\t0.5\t1\t2\t3\n", "inch");
  ASSERT_TRUE(tabs) << test::faults_text(tabs);
  EXPECT_EQ(*tabs->points[0].time_s, 0.5);
  EXPECT_DOUBLE_EQ(tabs->points[0].p_m.x(), 0.0254);
}

TEST(PointExport, RefusesColumnsThatAreNotClear) {
  EXPECT_THAT(faults_of_points("1 2 3 4 5 6\n"),
              HasSubstr("points.txt:1:1: what the 6 columns are is not clear: add a first line"));
  EXPECT_THAT(faults_of_points("A 1 2 3 4 5 6 7\n"), HasSubstr("what the 8 columns are"));
  EXPECT_THAT(faults_of_points("Name,X,Y,Z\nA,1,2\n"), HasSubstr("3 values, expected 4"));
  EXPECT_THAT(faults_of_points("Name X Y Z\nA 1 1 2 3\n"), HasSubstr("here blanks"));
  EXPECT_THAT(faults_of_points("// AXES = SPHERICAL: R, T, P (mm)\nA, 1, 2, 3\n"),
              HasSubstr("not Cartesian"));
  EXPECT_THAT(faults_of_points("Name,Time,X,Y,Z\nA,12.5,1,2,3\n"),
              HasSubstr("seconds have the heading Time (s)"));
}

TEST(PointExport, RefusesAUnitThatIsNotThatOfTheFile) {
  EXPECT_THAT(faults_of_points(example_of("spatialanalyzer.txt"), "inch"),
              HasSubstr("the file states its unit, mm, and the option another one, inch"));
  EXPECT_THAT(faults_of_points("Name,X (feet),Y (feet),Z (feet)\nA,1,2,3\n"),
              HasSubstr("the file states its unit, feet"));
}

TEST(PointExport, NamesBadNumbersAndRepeatedPoints) {
  EXPECT_THAT(faults_of_points("A;1,5;2;3\n"),
              HasSubstr("points.txt:1:3: X: \"1,5\": not a number, has a decimal comma"));
  EXPECT_THAT(faults_of_points("A 1 nan 3\n"), HasSubstr("Y: \"nan\": must be finite"));
  EXPECT_THAT(faults_of_points("G,A,1,2,3\nH,A,1,2,3\nG,A,1,2,4\n"),
              HasSubstr("points.txt:3:1: Name: point \"A\" of this group is also in line 1"));
  EXPECT_THAT(faults_of_points("P\xe4 1 2 x\n"), HasSubstr("Z: \"x\""));
  EXPECT_THAT(faults_of_points("A 1 2 3"), HasSubstr("may be cut off"));
  EXPECT_THAT(faults_of_points("// nothing\n"), HasSubstr("has no points"));
  EXPECT_THAT(faults_of_points("\xFF\xFE"
                               "A"),
              HasSubstr("UTF-16"));
}

TEST(PointExport, IsNotMistakenForOtherFiles) {
  EXPECT_FALSE(is_point_export("x_mm,y_mm,z_mm\n1,2,3\n"));
  EXPECT_FALSE(is_point_export("time_s;x_mm;y_mm;z_mm\n0;1;2;3\n"));
  EXPECT_FALSE(is_point_export("1,2,3,4,5,6\n"));
  EXPECT_TRUE(is_point_export("# table\nA 1 2 3\n"));
  EXPECT_TRUE(is_point_export("Name;X;Y;Z\n"));
}

TEST(PointExport, GivesPointsOfATrackerWithTimesOrARate) {
  const auto stamped = exported("A 1 2 3 05/28/19 18:01:15.5\nB 1 2 4 05/28/19 18:01:15.75\n");
  const auto timed = tracker_of_export(*stamped, "points.txt", std::nullopt);
  ASSERT_TRUE(timed) << test::faults_text(timed);
  EXPECT_EQ(timed->frame, TrackerFile::Frame::Unstated);
  EXPECT_EQ(timed->points[1].time_s, 0.25);

  const auto plain = exported("1,2,3\n1,2,4\n1,2,5\n");
  EXPECT_THAT(test::faults_text(tracker_of_export(*plain, "points.txt", std::nullopt)),
              HasSubstr("points.txt:1:1: Time: no time: export time stamps"));
  EXPECT_EQ(tracker_of_export(*plain, "points.txt", 500.0)->points[2].time_s, 0.004);
  const auto whole = exported("A 1 2 3 05/28/19 18:01:15\nB 1 2 4 05/28/19 18:01:15\n");
  EXPECT_THAT(test::faults_text(tracker_of_export(*whole, "points.txt", std::nullopt)),
              HasSubstr("stamps of whole seconds"));
}

TEST(PointExport, NamesMissingPointsOfAListWithoutTimes) {
  const auto file = exported("0,0,0\n0,0,1\n0,0,2\n0,0,7\n0,0,8\n0,0,9\n");
  EXPECT_THAT(test::faults_text(tracker_of_export(*file, "points.txt", 500.0)),
              HasSubstr("points.txt:4:1: 5.000 mm after the point before"));
}

class ExportedVerification : public ::testing::Test {
 protected:
  [[nodiscard]] Result<VerificationFile> with_readings(const std::string& readings) const {
    const auto file = folder_.path() / "readings.csv";
    const auto written = replace_file(file, readings);
    EXPECT_TRUE(written);
    return verification_of_export(*points_, "points.txt", file);
  }

  TemporaryFolder folder_;
  Result<PointExport> points_ = exported("G,A,1,2,3\nG,B,4,5,6\nH,A,1,2,3.5\n");
};

TEST_F(ExportedVerification, TakesReadingsByName) {
  const auto file = with_readings("name,x_mm,y_mm,z_mm\nB,20,0,0\nA,10,0,0\n");
  ASSERT_TRUE(file) << test::faults_text(file);
  ASSERT_THAT(file->points, SizeIs(3));
  EXPECT_EQ(file->points[0].reading_m.x(), 0.01);
  EXPECT_EQ(file->points[2].reading_m.x(), 0.01);  // another shot of A
  EXPECT_EQ(file->points[1].measured_m, calib::Vector3(0.004, 0.005, 0.006));
  EXPECT_EQ(file->lines[2], 3u);
  EXPECT_EQ(file->readings->name, "readings.csv");
}

TEST_F(ExportedVerification, TakesReadingsInOrder) {
  const auto file = with_readings("x_mm,y_mm,z_mm\n10,0,0\n20,0,0\n10,0,0\n");
  ASSERT_TRUE(file) << test::faults_text(file);
  EXPECT_EQ(file->points[1].reading_m.x(), 0.02);
  EXPECT_THAT(test::faults_text(with_readings("x_mm,y_mm,z_mm\n10,0,0\n")),
              HasSubstr("1 readings, points.txt has 3 points"));
}

TEST_F(ExportedVerification, NamesNamesThatDoNotFit) {
  EXPECT_THAT(test::faults_text(with_readings("name,x_mm,y_mm,z_mm\nA,10,0,0\n")),
              HasSubstr("no row of point \"B\" (points.txt, line 2)"));
  EXPECT_THAT(test::faults_text(with_readings("name,x_mm,y_mm,z_mm\nA,1,0,0\nC,1,0,0\n")),
              HasSubstr("name: \"C\": must be A or B"));
  EXPECT_THAT(test::faults_text(with_readings("name,x_mm,y_mm,z_mm\nA,1,0,0\nA,1,0,0\nB,1,0,0\n")),
              HasSubstr("\"A\" is also in line 2"));
}

}  // namespace
}  // namespace abbe::daemon
