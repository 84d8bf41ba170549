#include "abbe/dds/grid_comparison.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "sample_messages.hpp"

namespace abbe::dds {
namespace {

using calib::Vector3;
using daemon::ErrorCode;

std::vector<v1::GridNode> sample_nodes() {
  std::vector<v1::GridNode> nodes;
  for (const auto& slice : test::grid_slices())
    nodes.insert(nodes.end(), slice.nodes().begin(), slice.nodes().end());
  return nodes;
}

Vector3 sample_error(const Vector3& p) {
  const auto e = test::error_at({p[0], p[1], p[2]});
  return {e[0], e[1], e[2]};
}

/// Four points that span the volume, with the errors of the sample grid plus `rest`.
std::vector<KnownError> known_with(const auto& rest) {
  std::vector<KnownError> known;
  for (const Vector3& p :
       {Vector3(0.1, 0.2, 0.33), Vector3(0.7, 0.1, 0.2), Vector3(0.2, 0.75, 0.1), Vector3(0.4, 0.4, 0.8)}) {
    known.push_back({p, sample_error(p) + rest(p)});
  }
  return known;
}

TEST(GridInterpolation, IsExactAtAndBetweenNodesForErrorsLinearInEachCoordinate) {
  const auto grid = GridInterpolation::create(sample_nodes());
  ASSERT_TRUE(grid.has_value());
  for (const Vector3& p :
       {Vector3(0, 0, 0), Vector3(0.8, 0.8, 0.8), Vector3(0.33, 0.41, 0.77), Vector3(0.1, 0.2, 0.3)}) {
    Vector3 error;
    ASSERT_TRUE(grid->at(p, error));
    EXPECT_LT((error - sample_error(p)).norm(), 1e-18) << p.transpose();  // rounding of errors of 1e-5 m
  }
}

TEST(GridInterpolation, OutsideHasNoAnswer) {
  const auto grid = GridInterpolation::create(sample_nodes());
  ASSERT_TRUE(grid.has_value());
  Vector3 error;
  EXPECT_FALSE(grid->at({0.9, 0.1, 0.1}, error));
  EXPECT_FALSE(grid->at({0.1, -1e-6, 0.1}, error));
}

TEST(GridInterpolation, HasNoAnswerInACellWithACornerTheDataDidNotCover) {
  auto nodes = sample_nodes();
  for (auto& node : nodes) node.inside(node.position_m()[2] < 0.75);
  const auto grid = GridInterpolation::create(nodes);
  ASSERT_TRUE(grid.has_value());
  Vector3 error;
  EXPECT_TRUE(grid->at({0.1, 0.2, 0.65}, error));
  EXPECT_FALSE(grid->at({0.1, 0.2, 0.75}, error));
}

TEST(GridInterpolation, RefusesAGridWithAHole) {
  auto nodes = sample_nodes();
  nodes.erase(nodes.begin() + 100);
  EXPECT_FALSE(GridInterpolation::create(nodes).has_value());
}

TEST(GridComparison, ARigidMotionIsWhatNoMeasurementSees) {
  const Vector3 shift(3e-6, 0, -2e-6), turn(1e-6, 2e-6, -1e-6);
  const auto known = known_with([&](const Vector3& p) -> Vector3 { return shift + turn.cross(p); });
  const auto comparison = compare(known, GridInterpolation::create(sample_nodes()).value());
  ASSERT_TRUE(comparison.has_value());
  EXPECT_GT(comparison->after.mean_m, 1e-6);
  EXPECT_LT(comparison->after_rigid_free.max_m, 1e-12);  // second order of the turn and rounding
}

TEST(GridComparison, PointsOutsideAreCountedAndLeftOut) {
  auto known = known_with([](const Vector3&) { return Vector3::Zero().eval(); });
  known.push_back({{2.0, 0, 0}, {1.0, 0, 0}});
  const auto comparison = compare(known, GridInterpolation::create(sample_nodes()).value());
  ASSERT_TRUE(comparison.has_value());
  EXPECT_EQ(comparison->points, 4u);
  EXPECT_EQ(comparison->outside, 1u);
  EXPECT_LT(comparison->before.max_m, 1e-3);
}

TEST(GridComparison, PointsOnALineAreTooFew) {
  std::vector<KnownError> known;
  for (const double x : {0.1, 0.2, 0.3}) known.push_back({{x, 0.1, 0.1}, Vector3::Zero()});
  const auto comparison = compare(known, GridInterpolation::create(sample_nodes()).value());
  ASSERT_FALSE(comparison.has_value());
  EXPECT_EQ(comparison.error().code, ErrorCode::DataInsufficient);
}

struct KnownErrorsFile : testing::Test {
  std::filesystem::path file =
      std::filesystem::path(testing::TempDir()) /
      (std::string("abbe-known-") + testing::UnitTest::GetInstance()->current_test_info()->name());
  ~KnownErrorsFile() override { std::filesystem::remove(file); }
  std::string error_for(const std::string& text) {
    std::ofstream(file) << text;
    const auto read = read_known_errors(file);
    return read ? "" : read.error().text;
  }
};

TEST_F(KnownErrorsFile, ReadsColumnsInAnyOrderAndIgnoresOthers) {
  std::ofstream(file) << "# truth\nname,ez_um,ey_um,ex_um,z_mm,y_mm,x_mm\na,3,2,1,30,20,10\n";
  const auto known = read_known_errors(file);
  ASSERT_TRUE(known.has_value());
  ASSERT_EQ(known->size(), 1u);
  EXPECT_NEAR((*known)[0].position_m[0], 0.01, 1e-15);
  EXPECT_NEAR((*known)[0].error_m[2], 3e-6, 1e-18);
}

TEST_F(KnownErrorsFile, NamesTheMissingColumn) {
  EXPECT_THAT(error_for("x_mm,y_mm,z_mm,ex_um,ey_um\n1,2,3,4,5\n"),
              testing::HasSubstr(":1: ez_um: column is missing"));
}

TEST_F(KnownErrorsFile, NamesTheCellThatIsNoNumber) {
  EXPECT_THAT(error_for("x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n1,2,oops,4,5,6\n"),
              testing::HasSubstr(":2: z_mm: \"oops\" is not a number"));
}

TEST_F(KnownErrorsFile, RefusesAShortRowNotANumberAndNoRowAtAll) {
  const std::string header = "x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  EXPECT_THAT(error_for(header + "1,2,3\n"), testing::HasSubstr("too short"));
  EXPECT_THAT(error_for(header + "1,2,nan,4,5,6\n"), testing::HasSubstr("not a number"));
  EXPECT_THAT(error_for(header), testing::HasSubstr("has no row"));
}

}  // namespace
}  // namespace abbe::dds
