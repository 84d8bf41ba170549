#include "abbe/calib/geometry/usual_mistakes.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace abbe::calib {
namespace {

using ::testing::HasSubstr;

/// X -300 to 300 mm, Y -250 to 250 mm, Z -400 to 0 mm, times `scale`.
MachineNodes travel_times(double scale = 1.0) {
  MachineNodes travel;
  travel[0].nodes_m = {-0.3 * scale, 0.3 * scale};
  travel[1].nodes_m = {-0.25 * scale, 0.25 * scale};
  travel[2].nodes_m = {-0.4 * scale, 0.0};
  return travel;
}

const std::vector<Vector3> kPathInTravel{
    {-0.3, -0.25, -0.4}, {0.0, 0.25, 0.0}, {0.3, 0.0, -0.4}, {0.0, -0.25, -0.4}};

std::vector<Vector3> path_times(double factor) {
  std::vector<Vector3> path = kPathInTravel;
  for (Vector3& p : path) p *= factor;
  return path;
}

TEST(CorrectionsInsideTravel, DoNotNameAUnitForACoordinateALittleOutside) {
  for (const double excess_m : {1e-3, 30e-6, 0.1e-3}) {
    std::vector<Vector3> path = kPathInTravel;
    path[2].x() += excess_m;
    EXPECT_EQ(corrections_inside_travel(path, travel_times()), "") << excess_m;
  }
}

TEST(CorrectionsInsideTravel, DoNotNameAReversalForACoordinateALittleOutside) {
  MachineNodes travel = travel_times();
  travel[0].nodes_m = {-0.5, 0.3};
  std::vector<Vector3> path = kPathInTravel;
  path[2].x() += 1e-3;
  EXPECT_EQ(corrections_inside_travel(path, travel), "");
}

TEST(CorrectionsInsideTravel, NameTheUnitInWhichThePathFillsTheTravel) {
  EXPECT_THAT(corrections_inside_travel(path_times(1e3), travel_times()),
              HasSubstr("lengths in um instead of mm"));
  EXPECT_THAT(corrections_inside_travel(kPathInTravel, travel_times(1.0 / 25.4)),
              HasSubstr("the travel of the axes in inches instead of mm"));
  // a path of 40 mm in um is inside, but does not fill the travel
  EXPECT_EQ(corrections_inside_travel(path_times(1e3 * 0.04), travel_times()), "");
}

TEST(CorrectionsInsideTravel, NameAReversedAxis) {
  std::vector<Vector3> path = kPathInTravel;
  for (Vector3& p : path) p.z() = -p.z();
  // X and Y are symmetric, so that they may be reversed, too.
  EXPECT_THAT(corrections_inside_travel(path, travel_times()),
              HasSubstr("; all are inside with Z reversed"));
}

std::vector<std::string> texts(const std::vector<TriedCorrection>& found) {
  std::vector<std::string> all;
  for (const TriedCorrection& t : found) all.push_back(t.text);
  return all;
}

TEST(FarBetter, NamesTheBestFirstAndWhatFitsEquallyWell) {
  EXPECT_THAT(texts(far_better(10.0, {{"a", 3.0}, {"b", 2.1}, {"c", 9.0}, {"d", 3.3}})),
              testing::ElementsAre("b", "a"));
  EXPECT_THAT(texts(far_better(10.0, {{"a", 3.0}, {"b", 0.1}})), testing::ElementsAre("b"));
}

TEST(FarBetter, NamesNothingThatIsOnlySomewhatBetter) {
  EXPECT_TRUE(far_better(10.0, {{"a", 3.4}, {"b", 10.0}}).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(far_better(nan, {{"a", 3.4}}).empty());
  EXPECT_TRUE(
      far_better(10.0, {{"a", nan}, {"b", std::numeric_limits<double>::infinity()}}).empty());
  EXPECT_TRUE(far_better(10.0, {}).empty());
}

TEST(AngleMistakes, GiveTheRightPointFromTheWrongAngles) {
  constexpr double kRange_m = 2.0, kAzimuth = 0.7, kElevation = -0.3;
  const Vector3 right = from_spherical(kRange_m, kAzimuth, kElevation);
  const double zenith = 0.5 * std::numbers::pi - kElevation;
  ASSERT_EQ(angle_mistakes().size(), 2u);
  EXPECT_LT((angle_mistakes()[1].corrected(from_spherical(kRange_m, kElevation, kAzimuth)) - right)
                .norm(),
            1e-12);
  // above the tracker, where a zenith angle is also a possible elevation
  const Vector3 above = from_spherical(kRange_m, kAzimuth, 0.3);
  EXPECT_LT(
      (angle_mistakes()[0].corrected(from_spherical(kRange_m, kAzimuth, zenith - 0.6)) - above)
          .norm(),
      1e-12);
}

}  // namespace
}  // namespace abbe::calib
