#include "abbe/sim/touching.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "abbe/sim/weak_stiffness.hpp"

namespace abbe::sim {
namespace {

struct Touching : testing::Test {
  void plan() {
    program = plan_touching(truth, array, options);
    path = *PathMotion::plan(program.path);
    edges_s = edge_times_s(program, truth, path, array.tip_radius_m, options);
  }

  TruthMachine truth = weak_stiffness_machine();
  BallArray array = reference_ball_array();
  TouchingOptions options{.positions = {4}, .points_per_ball = 6, .points_per_block = 5, .noise_m = 0.0};
  TouchingProgram program;
  PathMotion path = *PathMotion::plan({.vertices = {PathVertex{}}});
  std::vector<double> edges_s;
};

TEST_F(Touching, TouchesEveryBallAndFaceOnceAPoint) {
  plan();
  EXPECT_EQ(program.moves.size(), 9u * 6u + 2u * 5u);
  EXPECT_EQ(edges_s.size(), program.moves.size());
  EXPECT_TRUE(std::ranges::is_sorted(edges_s));
}

TEST_F(Touching, TheTipMeetsTheTrueSurfaceAtTheEdge) {
  options.delay_s = options.jitter_s = 0.0;
  plan();
  for (std::size_t i = 0; i < edges_s.size(); ++i) {
    const ProbingMove& move = program.moves[i];
    const Eigen::Vector3d tip_m = position_m(truth, path.at(edges_s[i]).q_m);
    const double distance_m = move.radius_m > 0.0 ? (tip_m - move.centre_m).norm() - move.radius_m
                                                  : (tip_m - move.place_m).dot(move.normal);
    EXPECT_NEAR(distance_m, array.tip_radius_m, 1e-12);
  }
}

TEST_F(Touching, TheApproachIsSteadyAroundTheContact) {
  plan();
  for (const double edge_s : edges_s) {
    for (const double s : {edge_s - 0.01, edge_s + 0.01})
      EXPECT_NEAR(path.at(s).velocity_m_per_s.norm(), options.probing_m_per_s, 1e-12);
  }
}

TEST_F(Touching, ASilentProbeHasNoEdgeADoubledTouchTwoAndAStrayOneMore) {
  plan();
  const std::size_t all = edges_s.size();
  options.missed = {3, 7};
  plan();
  EXPECT_EQ(edges_s.size(), all - 2);
  options.missed.clear();
  options.doubled = {3};
  plan();
  EXPECT_EQ(edges_s.size(), all + 1);
  const Eigen::Vector3d first = path.at(edges_s[3]).q_m, second = path.at(edges_s[4]).q_m;
  EXPECT_LT((first - second).norm(), 50e-9);
  options.doubled.clear();
  options.stray = {20};
  plan();
  EXPECT_EQ(edges_s.size(), all + 1);
}

TEST_F(Touching, TheSameSeedGivesTheSameEdges) {
  options.noise_m = 3e-6;
  plan();
  const auto first = edges_s;
  plan();
  EXPECT_EQ(edges_s, first);
  options.seed = 2;
  plan();
  EXPECT_NE(edges_s, first);
}

TEST(BallArray, StandsOnItsFirstBallAtEveryPosition) {
  for (const auto& T_machine_array : reference_positions())
    EXPECT_LT(
        (T_machine_array * reference_ball_array().balls.front().centre_m - Eigen::Vector3d(-0.09, 0.14, 0.03))
            .norm(),
        1e-15);
}

}  // namespace
}  // namespace abbe::sim
