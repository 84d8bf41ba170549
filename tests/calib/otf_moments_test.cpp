// Moments of the samples of each leg and cell against the rows of the samples themselves.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "abbe/calib/otf/live/moments.hpp"
#include "abbe/calib/otf/solve/solve.hpp"
#include "allocation_count.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

TableBasis moment_basis(const Machine& machine, TableOptions options = {}) {
  return *TableBasis::of(layout_of(machine), options);
}

MomentAccumulator moments_of(const Machine& machine, TableOptions options = {}) {
  return *MomentAccumulator::of(
      {moment_basis(machine, options), machine.target_offset_m, case_a_alignment(true), Noise{}});
}

/// Samples on a straight line that bows by 50 um, seen by the tracker.
std::vector<TrackerObservation> samples_on(const Vector3& from, const Vector3& to,
                                           const Vector3& target_m, std::size_t count) {
  const RigidTransform T = case_a_alignment(true);
  std::vector<TrackerObservation> samples;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    const double bow_m = 50e-6 * std::sin(std::numbers::pi * s);
    const Vector3 q = from + s * (to - from) + bow_m * Vector3(0.6, -0.5, 0.7);
    samples.push_back(
        {static_cast<double>(i) / 500.0, T.R.transpose() * (q + target_m - T.t_m), true});
  }
  return samples;
}

struct LegEnds {
  Vector3 from, to;
};
/// Parallel to an axis, in a plane, and through all cells; to nodes and to places between them.
const std::vector<LegEnds> kLegs{{{-0.3, 0.02, -0.4}, {0.3, 0.02, -0.4}},
                                 {{-0.3, -0.25, -0.4}, {0.3, 0.25, -0.4}},
                                 {{0.27, 0.21, -0.02}, {-0.28, -0.2, -0.37}},
                                 {{0.1, -0.25, -0.4}, {0.1, 0.0, 0.0}}};

/// Largest difference of the two normal equations, in units of the diagonal, and of chi2.
void expect_same_information(const estimation::Information& moments,
                             const estimation::Information& rows) {
  const Eigen::MatrixXd H = rows.R().transpose() * rows.R();
  const Eigen::VectorXd length = H.diagonal().cwiseSqrt();
  const Eigen::VectorXd scale = (length.array() > 0.0).select(length.cwiseInverse(), 0.0);
  const Eigen::MatrixXd dH = moments.R().transpose() * moments.R() - H;
  EXPECT_LT((scale.asDiagonal() * dH * scale.asDiagonal()).cwiseAbs().maxCoeff(), 1e-12);

  const Eigen::VectorXd g = rows.R().transpose() * rows.z();
  const Eigen::VectorXd dg = moments.R().transpose() * moments.z() - g;
  EXPECT_LT(scale.cwiseProduct(dg).cwiseAbs().maxCoeff(), 1e-11 * scale.cwiseProduct(g).norm());

  const double all = rows.z().squaredNorm() + rows.rest();
  EXPECT_NEAR(moments.z().squaredNorm() + moments.rest(), all, 1e-11 * all);
  EXPECT_EQ(moments.rows(), rows.rows());
}

class MomentsOfChain : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Orders, MomentsOfChain,
                         testing::Values("[w X' b Y Z (C1) t]", "[w Y' b X Z t]", "[w b Z X Y t]"));

TEST_P(MomentsOfChain, StateWhatTheRowsOfTheSamplesState) {
  const Machine machine = coarse_machine(GetParam());
  MomentAccumulator moments = moments_of(machine);
  Observations o{.basis = moment_basis(machine), .target_offset_m = machine.target_offset_m};
  for (const auto& [from, to] : kLegs) {
    const auto samples = samples_on(from, to, machine.target_offset_m, 400);
    append_samples(o, samples, from, to, case_a_alignment(true), {});
    moments.begin_leg(from, to);
    for (const TrackerObservation& sample : samples) {
      moments.add(sample.p_tracker_m);
    }
  }

  EXPECT_EQ(2 * moments.samples(), o.rows.size());
  expect_same_information(moments.information(), information_of(o).data);
}

/// One, two and three samples determine fewer than the six combinations of a cell.
TEST(Moments, OfVeryFewSamplesAreNotApproximated) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  const auto& [from, to] = kLegs[2];
  for (const std::size_t count : {1u, 2u, 3u, 5u}) {
    MomentAccumulator moments = moments_of(machine);
    Observations o{.basis = moment_basis(machine), .target_offset_m = machine.target_offset_m};
    const auto samples = samples_on(from, to, machine.target_offset_m, count);
    append_samples(o, samples, from, to, case_a_alignment(true), {});
    moments.begin_leg(from, to);
    for (const TrackerObservation& sample : samples) {
      moments.add(sample.p_tracker_m);
    }
    expect_same_information(moments.information(), information_of(o).data);
  }
}

/// 30 rounds through 60 cells: the rows of early cells are in R before the last cells exist.
TEST(Moments, OfMoreCellsThanAreKeptStateTheSame) {
  const Machine machine = case_a_machine();
  const auto& [from, to] = kLegs[2];
  const auto samples = samples_on(from, to, machine.target_offset_m, 100);
  MomentAccumulator once = moments_of(machine), often = moments_of(machine);
  constexpr std::size_t kRounds = 60;
  for (std::size_t round = 0; round < kRounds; ++round) {
    often.begin_leg(from, to);
    for (const TrackerObservation& sample : samples) {
      often.add(sample.p_tracker_m);
    }
  }
  once.begin_leg(from, to);
  for (const TrackerObservation& sample : samples) {
    once.add(sample.p_tracker_m);
  }

  estimation::Information sum(once.information().unknowns());
  for (std::size_t round = 0; round < kRounds; ++round) {
    sum += once.information();
  }
  expect_same_information(often.information(), sum);
}

/// A machine that stands where an axis passes a node: noise changes the cell at every sample.
TEST(Moments, OfAMachineThatStandsBetweenTwoCellsTakeNoMemory) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  MomentAccumulator moments = moments_of(machine);
  const Vector3 from(-0.3, 0.02, -0.4), to(0.3, 0.02, -0.4), node(-0.1, 0.02, -0.4);
  const RigidTransform T = case_a_alignment(true);
  const auto seen = [&](double dx) {
    return Vector3(T.R.transpose() * (node + Vector3(dx, 0, 0) + machine.target_offset_m - T.t_m));
  };
  moments.begin_leg(from, to);
  moments.add(seen(1e-6));
  moments.add(seen(-1e-6));

  const abbe::tests::AllocationCount allocations;
  for (int i = 0; i < 1000; ++i) {
    moments.add(seen(i % 2 == 0 ? 1e-6 : -1e-6));
  }
  EXPECT_EQ(allocations.value(), 0u);
  EXPECT_EQ(moments.samples(), 1002u);
}

TEST(Moments, IgnoreSamplesNearTheEndsOfALegAndBeforeTheFirstLeg) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  MomentAccumulator moments = moments_of(machine);
  const auto& [from, to] = kLegs[0];
  const auto samples = samples_on(from, to, machine.target_offset_m, 600);  // 1 mm apart
  moments.add(samples[300].p_tracker_m);
  EXPECT_EQ(moments.samples(), 0u);

  moments.begin_leg(from, to);
  for (const TrackerObservation& sample : samples) {
    moments.add(sample.p_tracker_m);
  }
  EXPECT_EQ(moments.samples(), 580u);
}

/// A table for each direction of travel: a leg driven in both directions determines the difference.
TEST(Moments, KnowTheDirectionOfTravel) {
  const Machine machine = coarse_machine("[w X' b Y Z (C1) t]");
  MomentAccumulator moments = moments_of(machine, {.travel = TravelDependence::Backlash});
  const auto& [from, to] = kLegs[0];
  const auto samples = samples_on(from, to, machine.target_offset_m, 100);
  for (const bool forward : {true, false}) {
    moments.begin_leg(forward ? from : to, forward ? to : from);
    for (const TrackerObservation& sample : samples) {
      moments.add(sample.p_tracker_m);
    }
  }

  const TableBasis basis = moment_basis(machine);
  const Eigen::MatrixXd R = moments.information().R();
  const Eigen::MatrixXd H = R.transpose() * R;
  // EYX has a backlash with the weight of its mean table; both directions cancel the coupling.
  const auto EYX = static_cast<Eigen::Index>(basis.layout().find({Motion::Y, Axis::X})->offset);
  const auto backlash = static_cast<Eigen::Index>(basis.size()) + 1;
  EXPECT_GT(H(backlash, backlash), 0.0);
  EXPECT_LT(std::abs(H(backlash, EYX)), 1e-9 * std::sqrt(H(backlash, backlash) * H(EYX, EYX)));
}

TEST(Moments, OfCubicTablesAreRefused) {
  const auto moments = MomentAccumulator::of(
      {moment_basis(case_a_machine(),
                    {.interpolation = {Interpolation::Linear, Interpolation::NaturalCubic,
                                       Interpolation::Linear}}),
       Vector3::Zero(),
       {},
       Noise{}});
  ASSERT_FALSE(moments);
  EXPECT_EQ(moments.error().code, ErrorCode::NotApplicable);
  EXPECT_NE(moments.error().text.find("axis Y"), std::string::npos) << moments.error().text;
}

}  // namespace
