/// Drift of the simulated tracker, and its visits of reference nests.

#include "abbe/sim/reference_nests.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::SizeIs;

const Eigen::Vector3d kDrift_m(16e-6, -8e-6, 4e-6);

NestVisits two_nests() {
  NestVisits visits;
  visits.nests = {{.position_m = {1.5, -0.9, 0.2}}, {.position_m = {1.8, 0.9, 0.1}}};
  visits.stay_s = 2.0;
  visits.move_s = 0.5;
  return visits;
}

/// Eight legs of 0.1 m, 1 s each.
PathPlan zigzag(const NestVisits& visits, double every_s) {
  PathPlan plan{.feed_m_per_s = 0.1, .acceleration_m_per_s2 = 10.0};
  for (int i = 0; i <= 8; ++i) plan.vertices.push_back({{0.1 * (i % 2), 0.0, 0.05 * (i / 2 % 2)}});
  plan.wait_s = visits.round_s();
  plan.wait_every_s = every_s;
  return plan;
}

PathMotion planned(const PathPlan& plan) {
  return PathMotion::plan(plan).value();
}

TEST(PathMotion, WaitsAtTheFirstAndLastInnerVertexAndInBetween) {
  const PathMotion motion = planned(zigzag(two_nests(), 1.5));
  ASSERT_GT(motion.waits_s().size(), 2u);
  EXPECT_GT(motion.waits_s().front(), motion.leg_end_s(0));
  EXPECT_LT(motion.waits_s().front(), motion.leg_begin_s(1));
  EXPECT_GT(motion.waits_s().back(), motion.leg_end_s(6));
  EXPECT_LT(motion.waits_s().back(), motion.leg_begin_s(7));
  for (const double begin_s : motion.waits_s()) {
    const double end_s = begin_s + two_nests().round_s();
    EXPECT_EQ(motion.at(begin_s).q_m, motion.at(end_s).q_m);
    EXPECT_EQ(motion.at(end_s).velocity_m_per_s.norm(), 0.0);
  }
}

TEST(PathMotion, WaitsLastOnlyAsLongAsTheRounds) {
  PathPlan without = zigzag({}, 1.5);
  EXPECT_THAT(planned(without).waits_s(), SizeIs(0));
  const PathMotion motion = planned(zigzag(two_nests(), 1e6));
  EXPECT_THAT(motion.waits_s(), SizeIs(2));
  EXPECT_NEAR(motion.duration_s() - planned(without).duration_s(), 2.0 * two_nests().round_s(),
              1e-9);
}

TEST(PathMotion, WithoutAnInnerVertexCanNotWait) {
  const auto motion = PathMotion::plan({.vertices = {{{0, 0, 0}}, {{1, 0, 0}}}, .wait_s = 1.0});
  ASSERT_FALSE(motion);
  EXPECT_THAT(motion.error().text, HasSubstr("no inner vertex"));
}

TEST(ReferenceNests, TheBeamGoesToEachAndBack) {
  const NestVisits visits = two_nests();
  const std::vector<double> rounds_s{10.0, 30.0};
  const auto target = [&](double time_s) { return beam_at(visits, rounds_s, time_s).target; };
  EXPECT_EQ(target(9.9), BeamTarget::Machine);
  EXPECT_EQ(target(10.2), BeamTarget::None);
  EXPECT_EQ(target(11.0), BeamTarget::Nest);
  EXPECT_EQ(target(12.7), BeamTarget::None);
  EXPECT_EQ(target(14.9), BeamTarget::Nest);
  EXPECT_EQ(target(15.2), BeamTarget::None);
  EXPECT_EQ(target(15.6), BeamTarget::Machine);
  EXPECT_EQ(beam_at(visits, rounds_s, 34.0).nest, 1u);
  EXPECT_EQ(beam_at(visits, rounds_s, 34.0).round, 1u);
}

TEST(ReferenceNests, AMovedNestStaysWhereItIs) {
  NestVisits visits = two_nests();
  visits.repeatability_m = 0.0;
  visits.nests[1].moved_m = {0.0, 50e-6, 0.0};
  visits.nests[1].moved_at_s = 20.0;
  const Beam second{.target = BeamTarget::Nest, .nest = 1, .round = 0};
  EXPECT_EQ(nest_position_m(visits, second, 19.0), visits.nests[1].position_m);
  const Eigen::Vector3d moved_m =
      nest_position_m(visits, second, 21.0) - visits.nests[1].position_m;
  EXPECT_LT((moved_m - visits.nests[1].moved_m).norm(), 1e-12);
}

TEST(ReferenceNests, VisitsScatterByTheirRepeatability) {
  const NestVisits visits = two_nests();
  double squares = 0.0;
  constexpr std::size_t kRounds = 400;
  for (std::size_t round = 0; round < kRounds; ++round) {
    const Beam beam{.target = BeamTarget::Nest, .nest = 1, .round = round};
    squares += (nest_position_m(visits, beam, 0.0) - visits.nests[1].position_m).squaredNorm();
  }
  // 1200 values: the standard deviation of their rms is 2 %
  EXPECT_NEAR(std::sqrt(squares / (3.0 * kRounds)), visits.repeatability_m,
              0.08 * visits.repeatability_m);
}

TEST(TrackerDrift, IsLinearOrARandomWalkWithTheStatedEnd) {
  const TrackerDrift linear = TrackerDrift::linear(kDrift_m);
  EXPECT_EQ(linear.at(-1.0), Eigen::Vector3d(0, 0, 0));
  EXPECT_LT((linear.at(0.25) - 0.25 * kDrift_m).norm(), 1e-12);
  EXPECT_EQ(linear.at(2.0), kDrift_m);

  Eigen::Vector3d squares = Eigen::Vector3d::Zero(), of_half = squares;
  constexpr int kWalks = 400;
  for (int seed = 0; seed < kWalks; ++seed) {
    const TrackerDrift walk = TrackerDrift::random_walk(kDrift_m, static_cast<std::uint64_t>(seed));
    squares += walk.at(1.0).cwiseAbs2() / kWalks;
    of_half += walk.at(0.5).cwiseAbs2() / kWalks;
  }
  // variance of 400 normal values: within 4 standard deviations
  const Eigen::Vector3d variance = kDrift_m.cwiseAbs2();
  EXPECT_LT((squares.cwiseQuotient(variance) - Eigen::Vector3d::Ones()).cwiseAbs().maxCoeff(),
            0.28);
  EXPECT_LT(
      (of_half.cwiseQuotient(variance) - Eigen::Vector3d::Constant(0.5)).cwiseAbs().maxCoeff(),
      0.14);
}

struct NestStream : testing::Test {
  static TrackerOptions exact(const NestVisits& visits) {
    TrackerOptions options;
    options.model.sigma_range_m = options.model.sigma_angle_rad = 0.0;
    options.model.nests = visits;
    options.model.nests.repeatability_m = 0.0;
    options.model.drift = TrackerDrift::linear(kDrift_m);
    return options;
  }

  VirtualMachine machine_{TruthMachine{}, planned(zigzag(two_nests(), 1.5))};
};

TEST_F(NestStream, ShowsTheNestsWithDriftAndNothingWhileTheBeamMoves) {
  test::TrackerScript script(machine_, exact(two_nests()), 10ms);
  script.start_streaming(20);
  const HostTime start = script.now + 1s;
  machine_.start(start);
  script.run(seconds_to_ns(machine_.path().duration_s() + 3.0));

  const auto points = script.points();
  std::size_t at_nests = 0;
  double longest_gap_s = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = 1e-3 * Eigen::Vector3d::Map(points[i].value.data());
    const DeviceTime t = points[i].time.to_device_time();
    if (i > 0)
      longest_gap_s =
          std::max(longest_gap_s, ns_to_seconds(t - points[i - 1].time.to_device_time()));
    for (const ReferenceNest& nest : two_nests().nests) {
      if ((p - nest.position_m).norm() > 1e-3) continue;
      ++at_nests;
      const HostTime at = host_time(exact({}).model, HostTime{1000s}, t);
      const double share = ns_to_seconds(at - start) / machine_.path().duration_s();
      EXPECT_LT((p - nest.position_m - share * kDrift_m).norm(), 1e-9);
    }
  }

  const std::size_t rounds = machine_.path().waits_s().size();
  const double of_a_nest = two_nests().stay_s / 20e-3;
  EXPECT_NEAR(static_cast<double>(at_nests), 2.0 * of_a_nest * static_cast<double>(rounds),
              2.0 * static_cast<double>(rounds));
  EXPECT_NEAR(longest_gap_s, two_nests().move_s, 25e-3);
}

}  // namespace
}  // namespace abbe::sim
