#include "abbe/dds/grid_nodes.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/dds/field_comparison.hpp"
#include "sample_messages.hpp"

namespace abbe::dds {
namespace {

using Eigen::Vector3d;

std::vector<v1::GridNode> sample_nodes() {
  std::vector<v1::GridNode> nodes;
  for (const auto& slice : test::grid_slices())
    nodes.insert(nodes.end(), slice.nodes().begin(), slice.nodes().end());
  return nodes;
}

Vector3d sample_error(const Vector3d& p) {
  const auto e = test::error_at({p[0], p[1], p[2]});
  return {e[0], e[1], e[2]};
}

struct Known {
  std::vector<Vector3d> positions_m, errors_m;
  void add(const Vector3d& p, const Vector3d& e) {
    positions_m.push_back(p);
    errors_m.push_back(e);
  }
  [[nodiscard]] auto compared() const {
    return compare(positions_m, errors_m, lattice_of(sample_nodes()).value());
  }
};

/// Four points that span the volume, with the errors of the sample grid plus `rest`.
Known known_with(const auto& rest) {
  Known known;
  for (const Vector3d& p : {Vector3d(0.1, 0.2, 0.33), Vector3d(0.7, 0.1, 0.2),
                            Vector3d(0.2, 0.75, 0.1), Vector3d(0.4, 0.4, 0.8)}) {
    known.add(p, sample_error(p) + rest(p));
  }
  return known;
}

TEST(ReceivedLattice, IsExactAtAndBetweenNodesForErrorsLinearInEachCoordinate) {
  const auto grid = lattice_of(sample_nodes());
  ASSERT_TRUE(grid.has_value());
  for (const Vector3d& p : {Vector3d(0, 0, 0), Vector3d(0.8, 0.8, 0.8), Vector3d(0.33, 0.41, 0.77),
                            Vector3d(0.1, 0.2, 0.3)}) {
    Vector3d error;
    ASSERT_TRUE(grid->at(p, error));
    EXPECT_LT((error - sample_error(p)).norm(), 1e-18)
        << p.transpose();  // rounding of errors of 1e-5 m
  }
}

TEST(ReceivedLattice, OutsideHasNoAnswer) {
  const auto grid = lattice_of(sample_nodes());
  ASSERT_TRUE(grid.has_value());
  Vector3d error;
  EXPECT_FALSE(grid->at({0.9, 0.1, 0.1}, error));
  EXPECT_FALSE(grid->at({0.1, -1e-6, 0.1}, error));
}

TEST(ReceivedLattice, HasNoAnswerInACellWithACornerTheDataDidNotCover) {
  auto nodes = sample_nodes();
  for (auto& node : nodes) node.inside(node.position_m()[2] < 0.75);
  const auto grid = lattice_of(nodes);
  ASSERT_TRUE(grid.has_value());
  Vector3d error;
  EXPECT_TRUE(grid->at({0.1, 0.2, 0.65}, error));
  EXPECT_FALSE(grid->at({0.1, 0.2, 0.75}, error));
}

TEST(ReceivedLattice, RefusesAGridWithAHole) {
  auto nodes = sample_nodes();
  nodes.erase(nodes.begin() + 100);
  EXPECT_FALSE(lattice_of(nodes).has_value());
}

TEST(GridComparison, ARigidMotionIsNotObservable) {
  const Vector3d shift(3e-6, 0, -2e-6), rotation(1e-6, 2e-6, -1e-6);
  const auto moved = [&](const Vector3d& p) -> Vector3d { return shift + rotation.cross(p); };
  const auto known = known_with(moved);
  const auto comparison = known.compared();
  ASSERT_TRUE(comparison.has_value());
  EXPECT_GT(comparison->after.mean_m, 1e-6);
  // Left are the second order of the rotation and rounding.
  EXPECT_LT(comparison->after_rigid_free.max_m, 1e-12);
}

/// The process that faces the network contains no mathematics of calib: this fit is written twice.
TEST(GridComparison, RemovesTheMotionThatCalibRemoves) {
  const auto bend = [](const Vector3d& p) -> Vector3d {
    return 1e-5 * Vector3d(p.y() * p.z(), 0.3 + p.x() * p.x(), p.x() - p.y());
  };
  const auto known = known_with(bend);
  const auto comparison = known.compared();
  ASSERT_TRUE(comparison.has_value());
  std::vector<Vector3d> left_m;
  for (const Vector3d& p : known.positions_m) left_m.push_back(bend(p));
  const auto expected = calib::rigid_free(known.positions_m, left_m);
  ASSERT_TRUE(expected.has_value());
  EXPECT_GT(expected->rigid_free.max_m, 1e-7);
  EXPECT_NEAR(comparison->after_rigid_free.max_m, expected->rigid_free.max_m, 1e-15);
  EXPECT_NEAR(comparison->after_rigid_free.mean_m, expected->rigid_free.mean_m, 1e-15);
}

TEST(GridComparison, PointsOutsideAreCountedAndLeftOut) {
  auto known = known_with([](const Vector3d&) { return Vector3d::Zero().eval(); });
  known.add({2.0, 0, 0}, {1.0, 0, 0});
  const auto comparison = known.compared();
  ASSERT_TRUE(comparison.has_value());
  EXPECT_EQ(comparison->points, 4u);
  EXPECT_EQ(comparison->outside, 1u);
  EXPECT_LT(comparison->before.max_m, 1e-3);
}

TEST(GridComparison, PointsOnALineAreTooFew) {
  Known known;
  for (const double x : {0.1, 0.2, 0.3}) known.add({x, 0.1, 0.1}, Vector3d::Zero());
  const auto comparison = known.compared();
  ASSERT_FALSE(comparison.has_value());
  EXPECT_EQ(comparison.error().code, daemon::ErrorCode::DataInsufficient);
}

}  // namespace
}  // namespace abbe::dds
