#include "abbe/sim/touching.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

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
  TouchingOptions options{
      .positions = {4}, .points_per_ball = 6, .points_per_block = 5, .noise_m = 0.0};
  TouchingProgram program;
  PathMotion path = *PathMotion::plan({.vertices = {PathVertex{}}});
  std::vector<double> edges_s;
};

TEST_F(Touching, TouchesEveryPointOfEveryBallAndFaceOnce) {
  plan();
  EXPECT_EQ(program.moves.size(), 9u * 6u + 2u * 5u);
  EXPECT_EQ(edges_s.size(), program.moves.size());
  EXPECT_TRUE(std::ranges::is_sorted(edges_s));
}

TEST_F(Touching, TheTipContactsTheTrueSurfaceAtTheEdge) {
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

TEST_F(Touching, AMissedTouchHasNoEdgeADoubledOneTwoAndAStrayTouchAddsOne) {
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

TEST(BallArray, HasItsFirstBallAtTheSamePointInEveryPosition) {
  for (const auto& T_machine_array : reference_positions())
    EXPECT_LT((T_machine_array * reference_ball_array().balls.front().centre_m -
               Eigen::Vector3d(-0.09, 0.14, 0.03))
                  .norm(),
              1e-15);
}

TEST(BallArray, EqualsTheStatedArrayByDefault) {
  const BallArray stated = reference_ball_array(), actual = true_array(stated, {});
  for (std::size_t i = 0; i < stated.balls.size(); ++i) {
    EXPECT_EQ(actual.balls[i].centre_m, stated.balls[i].centre_m);
    EXPECT_EQ(actual.balls[i].radius_m, stated.balls[i].radius_m);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(actual.faces[i].centre_m, stated.faces[i].centre_m);
    EXPECT_EQ(actual.faces[i].normal, stated.faces[i].normal);
    EXPECT_EQ(actual.faces[i].half_1_m, stated.faces[i].half_1_m);
  }
}

TEST(BallArray, ExpandsWithItsTemperature) {
  const BallArray stated = reference_ball_array();
  const BallArray warm = true_array(stated, {.temperature_C = 24.0, .alpha_per_K = 11.5e-6});
  EXPECT_NEAR(warm.balls[5].centre_m.x() - stated.balls[5].centre_m.x(), 0.65 * 46e-6, 1e-15);
  EXPECT_NEAR(warm.balls[5].radius_m / stated.balls[5].radius_m, 1.000046, 1e-15);
  EXPECT_EQ(warm.faces[1].normal, stated.faces[1].normal);
}

TEST(BallArray, DiffersFromTheStatedArrayByTheStatedUncertainty) {
  const BallArray stated = reference_ball_array();
  constexpr double kBall_m = 2e-6, kBlock_rad = 5e-6;
  constexpr std::uint64_t kSeeds = 200;
  double ball_m2 = 0.0, block_rad2 = 0.0;

  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const BallArray actual =
        true_array(stated, {.u_ball_m = kBall_m, .u_block_rad = kBlock_rad, .seed = seed});
    for (std::size_t i = 0; i < stated.balls.size(); ++i)
      ball_m2 += (actual.balls[i].centre_m - stated.balls[i].centre_m).squaredNorm() /
                 (3.0 * 9.0 * kSeeds);
    for (std::size_t i = 0; i < 2; ++i)
      block_rad2 +=
          (actual.faces[i].normal - stated.faces[i].normal).squaredNorm() / (2.0 * 2.0 * kSeeds);
  }

  // The standard error of a standard deviation of 5400 and 800 numbers is 1 % and 2.5 %. The
  // tolerances are four times that.
  EXPECT_NEAR(std::sqrt(ball_m2) / kBall_m, 1.0, 0.04);
  EXPECT_NEAR(std::sqrt(block_rad2) / kBlock_rad, 1.0, 0.1);
}

TEST(BallArray, WritesItsUncertaintyAndExpansionToItsFile) {
  const auto text = format_calibrator_toml(
      reference_ball_array(),
      {.alpha_per_K = 12e-6, .u_alpha_per_K = 1e-6, .u_ball_m = 2e-6, .u_block_rad = 5e-6});
  for (const char* line : {"\nalpha_um_per_m_K = 12\n", "\nu_alpha_um_per_m_K = 1\n",
                           "\nu_um = 2\n", "\nu_urad = 5\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << text;
  EXPECT_EQ(format_calibrator_toml(reference_ball_array()).find("alpha"), std::string::npos);
}

}  // namespace
}  // namespace abbe::sim
