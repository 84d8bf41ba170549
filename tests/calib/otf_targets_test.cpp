#include "abbe/calib/otf/identify/targets.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <iostream>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "nest_run.hpp"
#include "normalised_error.hpp"
#include "otf_run.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using abbe::tests::kAllRepetitions;
using abbe::tests::repetitions;
using testing::HasSubstr;
using testing::Not;

const std::vector<Vector3> kThreeRunTargets{
    {0.02, -0.015, -0.12}, {0.17, -0.015, -0.12}, {0.02, 0.135, -0.17}};

constexpr const char* kUsualChain = "[w X' b Y Z (C1) t]";

struct MadeTargetsOptions {
  unsigned seed = 1;
  double noise_factor = 1.0, error_scale_m = 10e-6;
  std::array<double, 3> range_offset_m{};  ///< of each run
  std::string chain = kUsualChain;
  Interpolation interpolation = Interpolation::Linear;
  std::vector<Vector3> targets_m = kThreeRunTargets;
  /// Runs of some 1000 s from one place of the tracker, which drifts to the other side in the
  /// second of them; two nests.
  std::optional<NestRunOptions> nests{};
};

/// Drift and visits in one run.
NestRunOptions nests_of_run(const MadeTargetsOptions& wanted, std::size_t run) {
  NestRunOptions of_run = *wanted.nests;
  of_run.nests_m.resize(2);
  of_run.seed = 10 * wanted.seed + static_cast<unsigned>(run);
  if (run == 1) {
    of_run.drift_m = -of_run.drift_m;
  }
  return of_run;
}

/// Runs of one machine with 18 random tables; the tracker stands elsewhere in each.
struct MadeTargets {
  Machine machine;
  Options options;
  Noise noise;
  Eigen::VectorXd truth;  ///< datum G1
  std::vector<std::vector<TrackerObservation>> samples;
  std::vector<TargetRun> runs;

  [[nodiscard]] TableBasis basis() const {
    return *TableBasis::of(*ParameterLayout::all_tables(machine.chain, machine.nodes),
                           TableOptions::all_axes(machine.interpolation));
  }
  [[nodiscard]] Vector3 V_m(const Vector3& q, const Vector3& t) const {
    return basis().V_m({.q_m = q, .tool_offset_m = t},
                       {truth.data(), static_cast<std::size_t>(truth.size())});
  }
};

RigidTransform turned_tracker(std::size_t run) {
  RigidTransform T = case_a_alignment(true);
  const double angle = 0.4 * static_cast<double>(run);
  Matrix3 R;
  R << std::cos(angle), -std::sin(angle), 0.0, std::sin(angle), std::cos(angle), 0.0, 0.0, 0.0, 1.0;
  return {R * T.R, R * T.t_m};
}

MadeTargets make_targets(const MadeTargetsOptions& wanted) {
  std::mt19937_64 random(wanted.seed);
  MadeTargets made;
  made.machine = coarse_machine(wanted.chain);
  made.machine.interpolation = wanted.interpolation;
  made.options.segment_samples = 10;
  made.options.orientation.scales_agree = true;
  const TableBasis basis = made.basis();
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(basis.size() + 6));
  const auto n = static_cast<Eigen::Index>(basis.size());
  U.head(n) = random_tables(basis.layout(), wanted.error_scale_m, random);
  made.truth = to_datum(ModelDatum::G1, basis.layout(), kThreeRunTargets, U)->head(n);

  const double slower = wanted.nests ? 10.0 : 1.0;
  const double samples_per_second = 250.0 / slower, speed_m_s = 0.4 / slower;
  for (std::size_t k = 0; k < wanted.targets_m.size(); ++k) {
    const RigidTransform T = turned_tracker(wanted.nests ? 0 : k);
    const Vector3& t = wanted.targets_m[k];
    std::vector<TrackerObservation>& samples = made.samples.emplace_back();
    for (const Vector3& q : drive(case_a_path(), speed_m_s, samples_per_second)) {
      const Vector3 V =
          basis.V_m({.q_m = q, .tool_offset_m = t}, {made.truth.data(), basis.size()});
      const Vector3 p = T.R.transpose() * (q + t + V - T.t_m);
      samples.push_back({static_cast<double>(samples.size()) / samples_per_second,
                         with_noise(p * (1.0 + wanted.range_offset_m.at(k) / p.norm()), made.noise,
                                    wanted.noise_factor, random),
                         true});
    }
    if (wanted.nests) {
      const NestRunOptions of_run = nests_of_run(wanted, k);
      samples = with_drift_and_visits(samples, of_run, made.noise, T);
      made.options.nests = nest_options(of_run, T);
    }
  }
  for (std::size_t k = 0; k < wanted.targets_m.size(); ++k) {
    made.runs.push_back({made.samples[k], case_a_path(), wanted.targets_m[k]});
  }
  return made;
}

Result<TargetsIdentification> identified_targets(const MadeTargets& made) {
  return identify_targets(made.runs, made.machine, made.noise, made.options);
}

/// Exact samples.
MadeTargets exact_targets(const std::string& chain) {
  MadeTargets made = make_targets({.noise_factor = 0.0, .error_scale_m = 30e-6, .chain = chain});
  made.options.estimator = Estimator::Simultaneous;
  return made;
}

/// Of exact_targets(), each chain identified once.
const Result<TargetsIdentification>& identified_exactly(const std::string& chain) {
  static std::map<std::string, Result<TargetsIdentification>> found;
  if (const auto one = found.find(chain); one != found.end()) {
    return one->second;
  }
  return found.emplace(chain, identified_targets(exact_targets(chain))).first->second;
}

/// Of the runs with the usual noise, each machine identified once.
const Result<TargetsIdentification>& identified_usual(unsigned seed) {
  static std::map<unsigned, Result<TargetsIdentification>> found;
  if (const auto one = found.find(seed); one != found.end()) {
    return one->second;
  }
  return found.emplace(seed, identified_targets(make_targets({.seed = seed}))).first->second;
}

TEST(SeveralTargets, DetermineAll18TablesFromExactSamples) {
  for (const char* chain : {kUsualChain, "[w b Z X Y (C1) t]"}) {
    const MadeTargets made = exact_targets(chain);
    const auto& found = identified_exactly(chain);
    ASSERT_TRUE(found) << found.error().text;
    EXPECT_EQ(found->statistics.unknowns - found->statistics.rank, 24u);
    EXPECT_EQ(found->statistics.datum_conditions, 24u);
    EXPECT_LT((found->model().U() - made.truth).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(SeveralTargets, GiveAModelForAToolThatWasNotMeasured) {
  const MadeTargets made = exact_targets(kUsualChain);
  const auto& found = identified_exactly(kUsualChain);
  ASSERT_TRUE(found) << found.error().text;
  const Vector3 other(-0.2, 0.3, 0.1);
  EXPECT_TRUE(found->model().holds_for_tool(other));
  for (const Vector3& q : tensor_grid(made.machine.nodes)) {
    EXPECT_LT((found->model().V_at(q, other) - made.V_m(q, other)).norm(), 1e-9);
  }
}

TEST(SeveralTargets, AreJoinedWithCubicTablesToo) {
  MadeTargets made = make_targets(
      {.noise_factor = 0.0, .error_scale_m = 30e-6, .interpolation = Interpolation::NaturalCubic});
  made.options.estimator = Estimator::Simultaneous;
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_EQ(found->model().interpolation(), Interpolation::NaturalCubic);
  // The datum of the truth is that of linear tables: V differs by a rigid motion.
  const Vector3 other(-0.2, 0.3, 0.1);
  std::vector<Vector3> points, left;
  for (const Vector3& q : tensor_grid(found->model().nodes())) {
    points.push_back(q + other);
    left.push_back(found->model().V_at(q, other) - made.V_m(q, other));
  }
  EXPECT_LT(rigid_free(points, left)->rigid_free.max_m, 1e-9);
}

/// (error / standard uncertainty)^2, summed over the independent combinations of the parameters.
struct ChiSquareOfErrors {
  double squares = 0.0;
  double combinations = 0.0;

  void add(const VolumetricModel& model, const Eigen::VectorXd& truth) {
    const Eigen::VectorXd scale = model.covariance().diagonal().unaryExpr(
        [](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 0.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        scale.asDiagonal() * model.covariance() * scale.asDiagonal());
    const Eigen::VectorXd along =
        eigen.eigenvectors().transpose() * scale.asDiagonal() * (model.U() - truth);
    constexpr double kFixed = 1e-9;  // relative variance of a combination that the datum fixes
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      if (const double variance = eigen.eigenvalues()(i); variance > kFixed) {
        squares += along(i) * along(i) / variance;
        combinations += 1.0;
      }
    }
  }
};

TEST(SeveralTargets, HaveTheErrorsThatTheyState) {
  ChiSquareOfErrors all;
  for (unsigned seed = 1; seed <= repetitions(4u); ++seed) {
    const MadeTargets made = make_targets({.seed = seed});
    const auto& found = identified_usual(seed);
    ASSERT_TRUE(found) << found.error().text;
    EXPECT_NEAR(found->statistics.sigma0, 1.0, 0.05);
    all.add(found->model(), made.truth);
  }

  // chi-square of n combinations: mean 1 after division by n, standard deviation sqrt(2 / n)
  EXPECT_GT(all.combinations, kAllRepetitions ? 150.0 : 75.0);
  if (kAllRepetitions) {
    EXPECT_NEAR(all.squares / all.combinations, 1.0, 3.0 * std::sqrt(2.0 / all.combinations));
  }
}

/// Mean error of V for the three targets on the grid of the nodes, rigid motions removed.
double mean_error_of_targets_m(const MadeTargets& made, const VolumetricModel& model) {
  double sum_m = 0.0;
  for (const Vector3& t : kThreeRunTargets) {
    std::vector<Vector3> points, left;
    for (const Vector3& q : tensor_grid(model.nodes())) {
      points.push_back(q + t);
      left.push_back(model.V_at(q, t) - made.V_m(q, t));
    }
    sum_m += rigid_free(points, left)->rigid_free.mean_m / 3.0;
  }
  return sum_m;
}

/// The drift of each run, from its visits and the rows of all runs.
TEST(SeveralTargets, DriftOfEachRunIsEstimatedFromItsNests) {
  const NestRunOptions drift{.drift_m = {16e-6, -16e-6, 16e-6}};
  double with_m = 0.0, without_drift_m = 0.0;
  ChiSquareOfErrors all;
  for (const unsigned seed : {1u, 2u}) {
    const MadeTargets still =
        make_targets({.seed = seed, .nests = NestRunOptions{.visits = false}});
    const MadeTargets drifting = make_targets({.seed = seed, .nests = drift});
    const auto of_still = identified_targets(still), found = identified_targets(drifting);
    ASSERT_TRUE(of_still && found) << found.error().text;
    for (const Solution& solution : found->solutions) {
      ASSERT_TRUE(solution.drift);
      EXPECT_GT(solution.drift->visits, 8u);
    }
    const auto end_m = [&](std::size_t run) {
      return found->solutions[run].drift->points.back().value_m;
    };
    EXPECT_LT((end_m(0) + end_m(1)).norm(), 10e-6) << "to opposite sides";
    EXPECT_GT(end_m(0).norm(), 15e-6);
    with_m += mean_error_of_targets_m(drifting, found->model());
    without_drift_m += mean_error_of_targets_m(still, of_still->model());
    all.add(found->model(), drifting.truth);
    RecordProperty("with_um", std::to_string(1e6 * with_m));
    RecordProperty("without_um", std::to_string(1e6 * without_drift_m));
  }
  EXPECT_LE(with_m, 1.2 * without_drift_m);
  RecordProperty("normalised", std::to_string(all.squares / all.combinations));
  EXPECT_NEAR(all.squares / all.combinations, 1.0, 4.0 * std::sqrt(2.0 / all.combinations));
}

TEST(SeveralTargets, WithNestsInOneRunOnlyTheOthersHaveNoDrift) {
  const NestRunOptions drift{.drift_m = {16e-6, -16e-6, 16e-6}};
  MadeTargets made = make_targets({.seed = 1, .nests = drift});
  const MadeTargets still = make_targets({.seed = 1, .nests = NestRunOptions{.visits = false}});
  made.samples[1] = still.samples[1];
  made.samples[2] = still.samples[2];
  made.runs[1].samples = made.samples[1];
  made.runs[2].samples = made.samples[2];
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_TRUE(found->solutions[0].drift);
  EXPECT_FALSE(found->solutions[1].drift);
  const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
}

TEST(SeveralTargets, OnALineAreRefused) {
  const Vector3 step(0.1, 0.0, 0.05);
  for (const auto& targets :
       {std::vector{kThreeRunTargets[0]}, std::vector{kThreeRunTargets[0], kThreeRunTargets[1]},
        std::vector<Vector3>{kThreeRunTargets[0], kThreeRunTargets[0] + step,
                             kThreeRunTargets[0] - 2.0 * step}}) {
    const auto found = identified_targets(make_targets({.targets_m = targets}));
    ASSERT_FALSE(found) << targets.size();
    EXPECT_EQ(found.error().code, ErrorCode::DegenerateGeometry);
    EXPECT_THAT(found.error().text, HasSubstr("three offsets that are not on a line"));
  }
}

void expect_range_offsets(std::span<const Solution> solutions,
                          const std::array<double, 3>& of_runs_m, double most_u,
                          double largest_u_m) {
  ASSERT_EQ(solutions.size(), of_runs_m.size());
  for (std::size_t k = 0; k < of_runs_m.size(); ++k) {
    const RangeOffset& offset = solutions[k].range_offset;
    EXPECT_NEAR(offset.value_m, of_runs_m.at(k), most_u * offset.u_m);
    EXPECT_LT(offset.u_m, largest_u_m);
  }
}

TEST(SeveralTargets, EstimateTheOffsetOfTheRangesOfEachRun) {
  for (const std::array<double, 3>& of_runs_m :
       {std::array{15e-6, 15e-6, 15e-6}, std::array{15e-6, -20e-6, 5e-6}}) {
    MadeTargets made = make_targets({.range_offset_m = of_runs_m});
    made.noise.u_range_offset_m = 20e-6;
    const auto found = identified_targets(made);
    ASSERT_TRUE(found) << found.error().text;
    expect_range_offsets(found->solutions, of_runs_m, 3.0, 5e-6);
    EXPECT_NEAR(found->statistics.sigma0, 1.0, 0.05);
  }
}

constexpr std::array<std::array<double, 3>, 4> kHomedAgain_m{
    {{9e-6, -6e-6, -3e-6}, {-2e-6, 10e-6, -8e-6}, {6e-6, 5e-6, -10e-6}, {-7e-6, -5e-6, 8e-6}}};

/// The tracker is homed again before each run: offsets of 7 um rms where 6 um are stated.
TEST(SeveralTargets, HaveTheErrorsThatTheyStateWhenTheTrackerWasHomedAgain) {
  ChiSquareOfErrors all;
  unsigned seed = 0;
  for (const std::array<double, 3>& of_runs_m :
       std::span(kHomedAgain_m).first(repetitions(kHomedAgain_m.size()))) {
    MadeTargets made =
        make_targets({.seed = ++seed, .error_scale_m = 30e-6, .range_offset_m = of_runs_m});
    made.noise.u_range_offset_m = 6e-6;
    const auto found = identified_targets(made);
    ASSERT_TRUE(found) << found.error().text;
    all.add(found->model(), made.truth);
    const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
    ASSERT_TRUE(verdict) << verdict.error().text;
    EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  }
  std::cout << "mean squared normalised error " << all.squares / all.combinations << "\n";
  EXPECT_GT(all.combinations, 0.0);
  if (kAllRepetitions) {
    EXPECT_NEAR(all.squares / all.combinations, 1.0, 3.0 * std::sqrt(2.0 / all.combinations));
  }
}

/// With reference nests, each run has an offset beside its drift, too.
TEST(SeveralTargets, EstimateTheOffsetOfEachRunBesideItsDrift) {
  const std::array of_runs_m{15e-6, -20e-6, 5e-6};
  MadeTargets made = make_targets(
      {.range_offset_m = of_runs_m, .nests = NestRunOptions{.drift_m = {16e-6, -16e-6, 16e-6}}});
  made.noise.u_range_offset_m = 20e-6;
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  expect_range_offsets(found->solutions, of_runs_m, 4.0, 15e-6);
}

TEST(SeveralTargets, StateTheUncertaintyOfScalesOnceForAllRuns) {
  MadeTargets made = make_targets({});
  const auto& without = identified_usual(1);
  made.noise.u_scale = 1e-6;
  made.noise.u_axis_scale = {0.0, 2e-6, 0.0};
  const auto with = identified_targets(made);
  ASSERT_TRUE(without && with);
  const auto variance_at = [](const TargetsIdentification& found, const Vector3& q) {
    return found.model().error_at(q, kThreeRunTargets[0]).cov_V_m2(1, 1);
  };
  // Along Y, from the reference at 0: 1 ppm of the ranges and 2 ppm of the axis over 0.25 m.
  const Vector3 q(0.0, 0.25, 0.0);
  EXPECT_NEAR(variance_at(*with, q) - variance_at(*without, q), 0.25e-6 * 0.25e-6 * 5.0, 1e-15);
}

TEST(SeveralTargets, AreJudgedTogether) {
  const MadeTargets made = make_targets({.seed = 3, .error_scale_m = 30e-6});
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  EXPECT_LT(verdict->held_out.candidate, 1.1);
  std::size_t rows = 0;
  for (const Observations& o : found->observations) {
    rows += o.rows.size();
  }
  EXPECT_EQ(verdict->held_out.observations + verdict->held_out.not_held_out, rows);
}

/// A wrong offset in the configuration by a constant is only a rigid motion of its run; one that
/// belongs to another run is a contradiction.
TEST(SeveralTargets, WithExchangedOffsetsDoNotFit) {
  MadeTargets made = make_targets({.seed = 3, .error_scale_m = 100e-6});
  std::swap(made.runs[0].target_offset_m, made.runs[1].target_offset_m);
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  EXPECT_GT(found->statistics.sigma0, 1.5);
  const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  ASSERT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons.front(), HasSubstr("the run contradicts the others: offset"));
  EXPECT_THAT(testing::PrintToString(verdict->reasons), Not(HasSubstr("nodes are too far apart")));
}

/// The given position is that of the tracker in the first run.
TEST(SeveralTargets, ComparesTheTrackersPositionInTheFirstRunOnly) {
  MadeTargets made = make_targets({.seed = 3, .error_scale_m = 30e-6});
  made.options.orientation = {.tracker_m = case_a_alignment(true).t_m};
  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
}

/// Its path file with two signs reversed: the errors belong to other places.
TEST(SeveralTargets, ContradictALaterRunWithARotatedPath) {
  MadeTargets made = make_targets({.seed = 3, .error_scale_m = 30e-6});
  const MachineNodes& nodes = made.machine.nodes;
  const auto mirrored = [&nodes](std::size_t a, double q_m) {
    const std::vector<double>& of = nodes[a].nodes_m;
    return of.front() + of.back() - q_m;
  };
  for (Vector3& q : made.runs[2].path.vertices_m) {
    q = {mirrored(0, q.x()), mirrored(1, q.y()), q.z()};
  }

  const auto found = identified_targets(made);
  ASSERT_TRUE(found) << found.error().text;
  const auto verdict = judge(found->observations, found->solutions, nullptr, {}, made.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  ASSERT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons.front(), HasSubstr("the run contradicts the others"));
}

TEST(SeveralTargets, NameTheRunThatDoesNotFitItsPath) {
  MadeTargets made = make_targets({});
  made.runs[1].path.vertices_m.resize(20);
  const auto found = identified_targets(made);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, HasSubstr("run 2: "));
}

/// Tables of 10 um at nodes 200 mm apart: their bends are 24 um, (200 / 50)^1.5 = 8 times the size.
TEST(SeveralTargets, HaveOnePriorForSmoothTables) {
  MadeTargets made = make_targets({});
  const auto& without = identified_usual(1);
  made.options.smoothness = SmoothnessOptions{.bend_m = {3e-6, 3e-6, 3e-6}};
  const auto with = identified_targets(made);
  ASSERT_TRUE(without && with) << with.error().text;
  ASSERT_TRUE(with->solutions.front().smoothness);
  const Smoothness& prior = *with->solutions.front().smoothness;
  EXPECT_GT(prior.rows, 0u);
  EXPECT_EQ(prior.left_out(), 0u);
  EXPECT_THAT(with->observations.front().notes,
              testing::Contains(HasSubstr("a prior for smooth tables was used")));
  const Eigen::VectorXd u = without->solutions.front().model.covariance().diagonal().cwiseSqrt();
  const Eigen::VectorXd change =
      with->solutions.front().model.U() - without->solutions.front().model.U();
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    EXPECT_LE(std::abs(change(i)), 3.0 * u(i) + 1e-15) << i;
  }
}

}  // namespace
