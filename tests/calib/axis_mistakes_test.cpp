#include "abbe/calib/geometry/axis_mistakes.hpp"

#include <gmock/gmock.h>

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

}  // namespace
}  // namespace abbe::calib
