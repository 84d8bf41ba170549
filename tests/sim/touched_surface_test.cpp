#include "abbe/sim/touched_surface.hpp"

#include <gtest/gtest.h>

namespace abbe::sim {
namespace {

/// Moves down through z = 0, up, and down again, at 10 mm/s and 20 mm/s.
PathMotion down_up_down() {
  PathPlan plan;
  plan.vertices = {
      {{0, 0, 0.01}}, {{0, 0, -0.01}, 0.01}, {{0, 0, 0.01}, 0.05}, {{0, 0, -0.01}, 0.02}};
  return *PathMotion::plan(plan);
}

TEST(TouchedSurface, IsTouchedOnlyOnDownwardMoves) {
  const auto path = down_up_down();
  const auto edges = edge_times_s({.delay_s = 0.0, .jitter_s = 0.0}, path);
  ASSERT_EQ(edges.size(), 2u);
  for (const double t : edges) EXPECT_NEAR(path.at(t).q_m[2], 0.0, 1e-12);
}

TEST(TouchedSurface, TheEdgeFollowsTheContactAfterTheDelay) {
  const auto path = down_up_down();
  const auto edges = edge_times_s({.delay_s = 2e-3, .jitter_s = 0.0}, path);
  ASSERT_EQ(edges.size(), 2u);
  EXPECT_NEAR(path.at(edges[0]).q_m[2], -2e-3 * 0.01, 1e-12);
  EXPECT_NEAR(path.at(edges[1]).q_m[2], -2e-3 * 0.02, 1e-12);
}

TEST(TouchedSurface, IsNotTouchedByAPathThatStaysAbove) {
  EXPECT_TRUE(edge_times_s({.surface_m = -0.02}, down_up_down()).empty());
}

}  // namespace
}  // namespace abbe::sim
