#include "abbe/tables/input_files.hpp"
#include "abbe/base/known_errors.hpp"

#include <gmock/gmock.h>

#include <fstream>
#include <string>

#include "abbe/base/sha256.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class InputFiles : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    const auto file =
        std::filesystem::path(::testing::TempDir()) /
        (std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + "_" + name);
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }
  std::vector<std::string> tracker_faults(const std::string& text) {
    const auto tracker = read_tracker_csv(write("tracker.csv", text));
    return tracker ? std::vector<std::string>{} : tracker.error().details;
  }
};

TEST_F(InputFiles, ReadTheCartesianTrackerForm) {
  const auto tracker =
      read_tracker_csv(write("t.csv", "time_s,x_mm,y_mm,z_mm\n0,1,2,3\n0.002,-1000,0.5,1e1\n"));
  ASSERT_TRUE(tracker);
  ASSERT_THAT(tracker->points, SizeIs(2));
  EXPECT_EQ(tracker->points[1].time_s, 0.002);
  EXPECT_EQ(tracker->points[1].p_tracker_m, calib::Vector3(-1.0, 0.0005, 0.01));
}

TEST_F(InputFiles, PlaceTheTrackerInTheFrameOfItsPoints) {
  const std::string option = "--tracker-centre-mm X,Y,Z";
  const auto points = [&](const std::string& columns) {
    return *read_tracker_csv(write("t.csv", "time_s," + columns + "\n0,1000,2000,3000\n"));
  };
  auto unstated = points("x_mm,y_mm,z_mm");
  const auto missing = place_tracker(unstated, std::nullopt, "t.csv", option);
  ASSERT_FALSE(missing);
  EXPECT_THAT(missing.error().text,
              AllOf(HasSubstr("t.csv: the columns x_mm, y_mm, z_mm do not state their frame"),
                    HasSubstr("tracker_x_mm"), HasSubstr(option)));
  ASSERT_TRUE(place_tracker(unstated, calib::Vector3(0.5, 0.0, -1.0), "t.csv", option));
  EXPECT_EQ(unstated.points[0].p_tracker_m, calib::Vector3(0.5, 2.0, 4.0));

  auto stated = points("tracker_x_mm,tracker_y_mm,tracker_z_mm");
  EXPECT_TRUE(place_tracker(stated, std::nullopt, "t.csv", option));
  const auto twice = place_tracker(stated, calib::Vector3(0.5, 0.0, -1.0), "t.csv", option);
  ASSERT_FALSE(twice);
  EXPECT_THAT(twice.error().text, HasSubstr("leave out --tracker-centre-mm"));

  auto near = points("x_mm,y_mm,z_mm");
  const auto inside = place_tracker(near, calib::Vector3(1.0, 2.1, 3.0), "t.csv", option);
  ASSERT_FALSE(inside);
  EXPECT_THAT(inside.error().text, HasSubstr("a point is 100 mm from the tracker"));
}

TEST_F(InputFiles, ReadTheSphericalTrackerForm) {
  const auto tracker = read_tracker_csv(
      write("t.csv",
            "time_s,range_mm,azimuth_rad,elevation_rad,status\n0,2000,1.5707963267948966,0,0\n"));
  ASSERT_TRUE(tracker) << tracker.error().details.front();
  // 2 m along y; the rounding of pi/2 leaves 1e-16 of it on x.
  EXPECT_LT((tracker->points[0].p_tracker_m - calib::Vector3(0, 2, 0)).norm(), 1e-15);
}

TEST_F(InputFiles, KeepUnusablePointsInTheirPlace) {
  const auto tracker = read_tracker_csv(
      write("t.csv", "time_s,x_mm,y_mm,z_mm,status\n0,1,2,3,0\n1,1,2,3,1\n2,1,2,3,2\n3,1,2,3,0\n"));
  ASSERT_TRUE(tracker);
  std::vector<bool> valid;
  for (const auto& point : tracker->points) valid.push_back(point.valid);
  EXPECT_THAT(valid, ElementsAre(true, true, false, true));
}

TEST_F(InputFiles, MayHaveCommentsBlankLinesAndColumnsInAnyOrder) {
  const auto points =
      read_points_csv(write("p.csv", "# by hand\r\nz_mm, x_mm ,y_mm\r\n\r\n# more\r\n3,1,+2\r\n"));
  ASSERT_TRUE(points) << points.error().details.front();
  EXPECT_THAT(points->points_m, ElementsAre(AxisPosition{0.001, 0.002, 0.003}));
}

TEST_F(InputFiles, ReportEveryBadCellWithLineColumnAndName) {
  EXPECT_THAT(
      tracker_faults("time_s,x_mm,y_mm,z_mm\n0,1,2,3\n# note\n1,nan,2,3\n2,1,two,3\n3,1,2,\n"),
      ElementsAre(AllOf(HasSubstr("tracker.csv:4:3: x_mm:"), HasSubstr("finite")),
                  AllOf(HasSubstr("tracker.csv:5:5: y_mm:"), HasSubstr("\"two\": not a number")),
                  AllOf(HasSubstr("tracker.csv:6:7: z_mm:"), HasSubstr("empty"))));
}

TEST_F(InputFiles, RefuseTimeThatDoesNotAscendBesideOtherFaults) {
  EXPECT_THAT(
      tracker_faults("time_s,x_mm,y_mm,z_mm\n1,1,2,3\n1,1,2,3\n2,1,2,3x\n3,1,2,3\n2.5,1,2,3\n"),
      ElementsAre(AllOf(HasSubstr(":3:1: time_s: 1 after 1")), HasSubstr(":4:7: z_mm:"),
                  HasSubstr(":6:1: time_s: 2.5 after 3")));
}

TEST_F(InputFiles, RefuseAMissingAndAnUnknownColumn) {
  EXPECT_THAT(tracker_faults("time_s,x_mm,y_mm,zmm\n0,1,2,3\n"),
              ElementsAre(AllOf(HasSubstr(":1:18: zmm: unknown column"),
                                HasSubstr("did you mean \"z_mm\"")),
                          HasSubstr(":1:1: z_mm: missing column")));
}

TEST_F(InputFiles, RefuseALineThatWasCutOff) {
  EXPECT_THAT(tracker_faults("time_s,x_mm,y_mm,z_mm\n0,1,2,3\n1,1,2,3"),
              ElementsAre(HasSubstr(":3:8: the last line")));
  EXPECT_THAT(tracker_faults("time_s,x_mm,y_mm,z_mm\n0,1,2,3\n1,1\n"),
              ElementsAre(HasSubstr("2 values, expected 4")));
}

TEST_F(InputFiles, RefuseAnEmptyFileAndAHeaderAlone) {
  EXPECT_THAT(tracker_faults(""), ElementsAre(HasSubstr("empty")));
  EXPECT_THAT(tracker_faults("time_s,x_mm,y_mm,z_mm\n"),
              ElementsAre(HasSubstr("at least 1 points")));
}

TEST_F(InputFiles, ShowAFaultOfManyLinesOnceWithItsCount) {
  std::string text = "time_s,x_mm,y_mm,z_mm\n";
  for (int i = 0; i < 50; ++i) text += std::to_string(i) + ",1,2,oops" + std::to_string(i) + "\n";
  EXPECT_THAT(tracker_faults(text),
              ElementsAre(AllOf(HasSubstr("tracker.csv:2:7: z_mm: \"oops0\": not a number"),
                                HasSubstr(", and 49 more like this"))));
}

TEST_F(InputFiles, ReportAnglesThatLookLikeDegrees) {
  EXPECT_THAT(tracker_faults("time_s,range_mm,azimuth_rad,elevation_rad\n0,2000,90,45\n"),
              ElementsAre(HasSubstr("azimuth_rad: more than one revolution"),
                          HasSubstr("elevation_rad: beyond the vertical")));
}

TEST_F(InputFiles, ReadAPathWithItsFeed) {
  const auto path =
      read_path_csv(write("path.csv", "x_mm,y_mm,z_mm,feed_mm_per_min\n0,0,0,600\n100,0,0,1200\n"));
  ASSERT_TRUE(path);
  EXPECT_THAT(path->vertices_m, ElementsAre(AxisPosition{0, 0, 0}, AxisPosition{0.1, 0, 0}));
  EXPECT_DOUBLE_EQ(path->feed_m_per_s[1], 0.02);
}

TEST_F(InputFiles, RefuseAPathThatDoesNotMove) {
  const auto path = read_path_csv(write("path.csv", "x_mm,y_mm,z_mm\n0,0,0\n0,0,0\n"));
  ASSERT_FALSE(path);
  EXPECT_THAT(path.error().details, ElementsAre(HasSubstr(":3:1: the same vertex")));
}

TEST_F(InputFiles, ReadAnEncoderLog) {
  const auto encoder =
      read_encoder_csv(write("e.csv", "time_s,x_mm,y_mm,z_mm\n0,1,2,3\n0.004,4,5,6\n"));
  ASSERT_TRUE(encoder);
  EXPECT_EQ(encoder->rows[1].time_s, 0.004);
  EXPECT_EQ(encoder->rows[1].reading_m, (AxisPosition{0.004, 0.005, 0.006}));
}

TEST_F(InputFiles, TimesAreSinceTheFirstRow) {
  const auto tracker = read_tracker_csv(
      write("t.csv", "time_s,x_mm,y_mm,z_mm\n# note\n1700000000.5,1,2,3\n1700000000.75,1,2,4\n"));
  ASSERT_TRUE(tracker);
  EXPECT_EQ(tracker->points[0].time_s, 0.0);
  EXPECT_EQ(tracker->points[1].time_s, 0.25);
  EXPECT_EQ(tracker->times.first_time_s, 1700000000.5);
  EXPECT_EQ(tracker->times.first_line, 3u);
  EXPECT_EQ(tracker->times.last_line, 4u);
  const auto encoder =
      read_encoder_csv(write("e.csv", "time_s,x_mm,y_mm,z_mm\n12.5,1,2,3\n12.75,4,5,6\n"));
  ASSERT_TRUE(encoder);
  EXPECT_EQ(encoder->rows[1].time_s, 0.25);
  EXPECT_EQ(encoder->times.first_time_s, 12.5);
}

TEST_F(InputFiles, MayHaveADirectionOfTravelPerPoint) {
  using calib::AxisTravel;
  using calib::Travel;
  const std::string header = "x_mm,y_mm,z_mm,dx,dy,dz\n";
  const auto points = read_points_csv(write("p.csv", header + "1,2,3,+,-,0\n1,2,3,-,-,+\n"));
  ASSERT_TRUE(points) << points.error().details.front();
  EXPECT_THAT(points->travel,
              ElementsAre(AxisTravel{Travel::Forward, Travel::Backward, Travel::Unknown},
                          AxisTravel{Travel::Backward, Travel::Backward, Travel::Forward}));
  const auto faulty = read_points_csv(write("p.csv", header + "1,2,3,+,1,0\n"));
  ASSERT_FALSE(faulty);
  EXPECT_THAT(faulty.error().details, ElementsAre(HasSubstr("p.csv:2:9: dy:")));
  const auto partial = read_points_csv(write("p.csv", "x_mm,y_mm,z_mm,dx\n1,2,3,+\n"));
  ASSERT_FALSE(partial);
  EXPECT_THAT(partial.error().details.front(), HasSubstr("dy: missing column"));
}

TEST_F(InputFiles, CarryTheHashOfTheirBytes) {
  const std::string text = "x_mm,y_mm,z_mm\n1,2,3\n";
  const auto points = read_points_csv(write("p.csv", text));
  ASSERT_TRUE(points);
  EXPECT_EQ(points->source.sha256, sha256_hex(text));
}

TEST_F(InputFiles, NameAMissingFile) {
  const auto points = read_points_csv("/nonexistent/points.csv");
  ASSERT_FALSE(points);
  EXPECT_EQ(points.error().code, ErrorCode::Io);
  EXPECT_THAT(points.error().text, HasSubstr("/nonexistent/points.csv"));
  EXPECT_THAT(points.error().details, IsEmpty());
}

TEST(Sha256, AgreesWithThePublishedExample) {
  // FIPS 180-4 example: the one-block message "abc".
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST_F(InputFiles, ReadKnownErrorsInMicrometres) {
  const auto errors = read_known_errors_csv(
      write("e.csv", "# truth\nez_um,ey_um,ex_um,z_mm,y_mm,x_mm,inside\n3,2,1,30,20,10,1\n"));
  ASSERT_TRUE(errors) << errors.error().details.front();
  ASSERT_THAT(errors->errors_m, SizeIs(1));
  EXPECT_EQ(errors->points_m[0], (AxisPosition{0.01, 0.02, 0.03}));
  EXPECT_LT((calib::Vector3(errors->errors_m[0].data()) - calib::Vector3(1e-6, 2e-6, 3e-6)).norm(),
            1e-20);
}

TEST_F(InputFiles, RefuseKnownErrorsWithoutAComponentOrARow) {
  const auto without =
      read_known_errors_csv(write("a.csv", "x_mm,y_mm,z_mm,ex_um,ey_um\n1,2,3,4,5\n"));
  ASSERT_FALSE(without);
  EXPECT_THAT(without.error().details, ElementsAre(HasSubstr(":1:1: ez_um: missing column")));
  const auto empty = read_known_errors_csv(write("b.csv", "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n"));
  ASSERT_FALSE(empty);
  EXPECT_THAT(empty.error().details, ElementsAre(HasSubstr("needs at least 1 points, has 0")));
}

}  // namespace
}  // namespace abbe::daemon
