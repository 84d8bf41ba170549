// Backlash as unknowns of on-the-fly calibration: simulated runs, and case C of the reference data.
#include "abbe/calib/otf/solve/backlash.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/identify/targets.hpp"
#include "backlash_run.hpp"
#include "encoder_run.hpp"
#include "repetitions.hpp"
#include "standstill_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using abbe::tests::repetitions;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// One value per table, within 5 um or 5 urad, of both signs.
BacklashOfRun backlash_of_14_tables(unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-5e-6, 5e-6);
  BacklashOfRun all{Eigen::VectorXd(14)};
  for (double& b : all.values) {
    b = uniform(random);
  }
  return all;
}

Result<Identification> identified_with(MadeRun run, TravelDependence backlash,
                                       Estimator estimator = Estimator::TwoStep) {
  run.options.backlash = backlash;
  run.options.estimator = estimator;
  return identify(run.samples, run.machine, run.path, run.noise, run.options);
}

Verdict verdict_on(const MadeRun& run, const Identification& id) {
  return *judge(id.observations, id.solution, nullptr, {}, run.options);
}

double mean_error_at_nodes_m(const MadeRun& run, const VolumetricModel& model) {
  std::vector<Vector3> points = tensor_grid(run.machine.nodes);
  for (Vector3& p : points) {
    p += run.machine.target_offset_m;
  }
  return rigid_free(points, errors_left(run, model))->rigid_free.mean_m;
}

void expect_within_four_u(std::span<const Backlash> found, const BacklashOfRun& truth) {
  ASSERT_EQ(std::ssize(found), truth.values.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Backlash& b = found[i];
    EXPECT_TRUE(b.determined) << label(b);
    EXPECT_NEAR(b.value, truth.values(static_cast<Eigen::Index>(i)), 4.0 * b.u) << label(b);
  }
}

TEST(AxisTravelOfAPath, IsHeldWhileAnAxisRestsAndUnknownBeforeItMoves) {
  const std::vector<Vector3> vertices_m{{0, 0, 0}, {1, 0, 0}, {1, -1, 0}, {0, -1, 0}};
  const std::vector<AxisTravel> legs = travel_along(vertices_m, Mode::OnTheFly);
  ASSERT_EQ(legs.size(), 3u);
  EXPECT_EQ(legs[0], (AxisTravel{Travel::Forward, Travel::Unknown, Travel::Unknown}));
  EXPECT_EQ(legs[1], (AxisTravel{Travel::Forward, Travel::Backward, Travel::Unknown}));
  EXPECT_EQ(legs[2], (AxisTravel{Travel::Backward, Travel::Backward, Travel::Unknown}));
}

TEST(AxisTravelOfAPath, OfAStandstillIsThatWhichReachedIt) {
  const auto reached = travel_along(std::vector<Vector3>{{0, 0, 0}, {1, 0, 0}}, Mode::Standstill);
  ASSERT_EQ(reached.size(), 2u);
  EXPECT_EQ(reached[0][0], Travel::Unknown);
  EXPECT_EQ(reached[1][0], Travel::Forward);
}

class BacklashOfARun : public testing::TestWithParam<Estimator> {};
INSTANTIATE_TEST_SUITE_P(OtfEstimators, BacklashOfARun,
                         testing::Values(Estimator::TwoStep, Estimator::Simultaneous));

TEST_P(BacklashOfARun, IsFoundWithItsSignAndTheModelIsTheMeanOfBothDirections) {
  for (unsigned seed = 1; seed <= repetitions(3u); ++seed) {
    const BacklashOfRun truth = backlash_of_14_tables(seed);
    const MadeRun run = make_backlash_run({.seed = seed, .noise_seed = seed}, truth);
    const auto id = identified_with(run, TravelDependence::Backlash, GetParam());
    ASSERT_TRUE(id) << id.error().text;
    expect_within_four_u(id->solution.backlash, truth);
    EXPECT_LT(mean_error_at_nodes_m(run, id->solution.model), 0.5e-6);
  }
}

TEST_P(BacklashOfARun, RefusesTheModelOnlyWhereItIsNotEstimated) {
  const MadeRun run = make_backlash_run({.seed = 4}, backlash_of_14_tables(4));
  const auto without = identified_with(run, TravelDependence::None, GetParam());
  const auto with = identified_with(run, TravelDependence::Backlash, GetParam());
  ASSERT_TRUE(without && with) << with.error().text;
  EXPECT_THAT(without->solution.backlash, IsEmpty());
  EXPECT_FALSE(verdict_on(run, *without).accepted);
  const Verdict verdict = verdict_on(run, *with);
  EXPECT_TRUE(verdict.accepted) << testing::PrintToString(verdict.reasons);
  EXPECT_THAT(verdict.notes, Contains(HasSubstr("backlash, forward minus backward: EXX ")));
}

TEST_P(BacklashOfARun, IsZeroOnAMachineWithoutItAndCostsLittle) {
  for (unsigned seed = 1; seed <= repetitions(3u); ++seed) {
    const MadeRun run = make_run({.seed = seed, .noise_seed = seed});
    const auto with = identified_with(run, TravelDependence::Backlash, GetParam());
    const auto without = identified_with(run, TravelDependence::None, GetParam());
    ASSERT_TRUE(with && without) << with.error().text;
    for (const Backlash& b : with->solution.backlash) {
      EXPECT_LT(std::abs(b.value), 4.0 * b.u) << label(b);
    }
    EXPECT_EQ(with->solution.statistics.rank, without->solution.statistics.rank + 14);
    const double u_m = correction_size(with->solution.model).u_m;
    EXPECT_LT(u_m, 1.5 * correction_size(without->solution.model).u_m);
    EXPECT_THAT(verdict_on(run, *with).notes, Not(Contains(HasSubstr("backlash"))));
  }
}

TEST(BacklashInOneAxis, IsNotFoundInTheOthers) {
  BacklashOfRun truth{Eigen::VectorXd::Zero(14)};
  truth.values(7) = -8e-6;  // EYY
  const MadeRun run = make_backlash_run({.seed = 2}, truth);
  const auto id = identified_with(run, TravelDependence::Backlash);
  ASSERT_TRUE(id) << id.error().text;
  expect_within_four_u(id->solution.backlash, truth);
  EXPECT_THAT(verdict_on(run, *id).notes,
              Contains(HasSubstr("backlash, forward minus backward: EYY -")));
}

/// Half of what is not corrected is in the uncertainty of the model.
TEST(BacklashInOneAxis, IsInTheUncertaintyOfV) {
  BacklashOfRun truth{Eigen::VectorXd::Zero(14)};
  truth.values(6) = 8e-6;  // EXY
  const MadeRun run = make_backlash_run({.seed = 2}, truth);
  const auto id = identified_with(run, TravelDependence::Backlash);
  ASSERT_TRUE(id) << id.error().text;
  const auto e = id->solution.model.error_at({0.1, 0.1, -0.2}, run.machine.target_offset_m);
  EXPECT_NEAR(std::sqrt(e.cov_V_m2(0, 0)), 4e-6, 0.2e-6);
  EXPECT_LT(std::sqrt(e.cov_V_m2(1, 1)), 1e-6);
}

/// Observations of a run as if X never moved backward.
Observations with_x_forward(const MadeRun& run, TravelDependence backlash) {
  Options options = run.options;
  options.backlash = backlash;
  Observations o = *observe(run.samples, run.machine, run.path, run.noise, options);
  for (AxisTravel& travel : o.travel) {
    travel[0] = Travel::Forward;
  }
  return with_basis(o, o.basis);
}

TEST(BacklashOfAnAxisInOneDirection, HasNoValueAndIsNamed) {
  const MadeRun run = make_run({});
  const Observations o = with_x_forward(run, TravelDependence::Backlash);
  const auto s = solve(o, run.options);
  ASSERT_TRUE(s) << s.error().text;
  for (const Backlash& b : s->backlash) {
    EXPECT_EQ(b.determined, b.motion.axis != Axis::X) << label(b);
  }
  EXPECT_THAT(notes_on(s->backlash),
              Contains(HasSubstr("does not determine, because an axis moves in one direction only "
                                 "or on too few legs: EXX, EYX, EZX, EAX, EBX, ECX")));
  EXPECT_THAT(largest_of_tables(s->backlash), testing::SizeIs(8));
}

/// The prior of a difference that the data do not determine changes nothing else.
TEST(BacklashOfAnAxisInOneDirection, LeavesTheModelAsItIs) {
  const MadeRun run = make_run({});
  Observations o = with_x_forward(run, TravelDependence::Backlash);
  for (AxisTravel& travel : o.travel) {
    travel = {Travel::Forward, Travel::Forward, Travel::Forward};
  }
  const auto with = solve(with_basis(o, o.basis), run.options);
  const auto without = solve(with_x_forward(run, TravelDependence::None), run.options);
  ASSERT_TRUE(with && without) << with.error().text;
  EXPECT_LT((with->model.U() - without->model.U()).cwiseAbs().maxCoeff(), 1e-11);
}

/// X moves on the first leg, Y on the second, Z on the third. Y and Z start in the state of
/// backward travel.
TEST(BacklashBeforeTheFirstMotion, OfAnAxisIsNotUsed) {
  const BacklashOfRun truth = backlash_of_14_tables(5);
  std::vector<Vector3> path_m{{0.3, 0.25, 0.0}, {-0.3, 0.25, 0.0}, {-0.3, -0.25, 0.0}};
  const std::vector<Vector3> all_axes = case_a_path().vertices_m;
  path_m.insert(path_m.end(), all_axes.begin(), all_axes.end());
  const MadeRun run = make_backlash_run({.seed = 5}, truth, path_m);

  const auto id = identified_with(run, TravelDependence::Backlash);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_EQ(id->observations.rows.front().leg, 2u);
  EXPECT_THAT(id->observations.notes,
              Contains(HasSubstr("the legs before 2 are not used: Z had not moved yet")));
  expect_within_four_u(id->solution.backlash, truth);
}

TEST(BacklashBeforeTheFirstMotion, OfAnAxisThatNeverMovesIsAnError) {
  const MadeRun run = make_run({});
  Observations o = with_x_forward(run, TravelDependence::Backlash);
  for (AxisTravel& travel : o.travel) {
    travel[1] = Travel::Unknown;
  }
  const auto first = first_with_backlash(o);
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(first.error().text, HasSubstr("the path does not move Y"));
}

/// The difference of EXX and EYX rises along X.
TEST(ForwardAndBackwardTables, ShowADifferenceThatDependsOnThePosition) {
  MadeRun run = make_run({.seed = 6});
  const ParameterLayout layout = layout_of(run.machine);
  BacklashOfRun truth{Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.squareness_offset()))};
  const std::vector<double>& x_m = run.machine.nodes[0].nodes_m;
  for (std::size_t i = 0; i < x_m.size(); ++i) {
    truth.values(static_cast<Eigen::Index>(i)) = 10e-6 * x_m[i];
    truth.values(static_cast<Eigen::Index>(x_m.size() + i)) = 4e-6 - 20e-6 * x_m[i];
  }
  run = make_backlash_run({.seed = 6}, truth);

  const auto id = identified_with(run, TravelDependence::Tables);
  ASSERT_TRUE(id) << id.error().text;
  expect_within_four_u(id->solution.backlash, truth);
  EXPECT_EQ(label(id->solution.backlash[0]), "EXX at -0.3 m");
  EXPECT_LT(mean_error_at_nodes_m(run, id->solution.model), 1e-6);
}

TEST(BacklashOfStandstills, IsFoundWithoutTheFirstPosition) {
  const StandstillRunOptions wanted{.positions = 80};
  MadeRun run = make_standstill_run(wanted);
  const BacklashOfRun truth = backlash_of_14_tables(7);
  add_backlash(run.samples,
               drive_and_stand(run.path.vertices_m, wanted.dwell_s, wanted.made.speed_m_s,
                               wanted.made.rate_hz),
               layout_of(run.machine), run.machine.target_offset_m, run.T_machine_tracker, truth);
  const auto id = identified_with(run, TravelDependence::Backlash);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_GT(id->observations.rows.front().leg, 0u);
  expect_within_four_u(id->solution.backlash, truth);
}

TEST(BacklashOfSeveralTargets, HasOneValueForEachOf18Tables) {
  MadeRun run = make_run({});
  run.options.backlash = TravelDependence::Backlash;
  const ParameterLayout layout = *ParameterLayout::all_tables(run.machine.chain, run.machine.nodes);
  BacklashOfRun truth{Eigen::VectorXd::LinSpaced(18, -6e-6, 8e-6)};
  const std::vector<Vector3> driven_m = drive(run.path, 0.4, 250.0);
  std::vector<std::vector<TrackerObservation>> samples;
  std::vector<TargetRun> runs;
  std::mt19937_64 noise(3);
  for (const Vector3& t :
       {Vector3(0.02, -0.015, -0.12), Vector3(0.17, -0.015, -0.12), Vector3(0.02, 0.135, -0.17)}) {
    auto& of_run = samples.emplace_back(run.samples);  // with their times
    for (std::size_t i = 0; i < of_run.size(); ++i) {
      const RigidTransform& T = run.T_machine_tracker;
      of_run[i].p_tracker_m =
          with_noise(T.R.transpose() * (driven_m[i] + t - T.t_m), run.noise, 1.0, noise);
    }
    add_backlash(of_run, driven_m, layout, t, run.T_machine_tracker, truth);
    runs.push_back({{}, run.path, t});
  }
  for (std::size_t k = 0; k < runs.size(); ++k) {
    runs[k].samples = samples[k];
  }

  const auto found = identify_targets(runs, run.machine, run.noise, run.options);
  ASSERT_TRUE(found) << found.error().text;
  expect_within_four_u(found->solutions.front().backlash, truth);
}

TEST(BacklashWithScaleReadings, IsFoundBesideTheClock) {
  EncoderRun made = make_encoder_run({});
  made.run.options.backlash = TravelDependence::Backlash;
  const BacklashOfRun truth = backlash_of_14_tables(8);
  add_backlash(made.run.samples, drive(made.run.path, 0.4, 250.0), layout_of(made.run.machine),
               made.run.machine.target_offset_m, made.run.T_machine_tracker, truth);
  const auto id = identify_with_readings(made);
  ASSERT_TRUE(id) << id.error().text;
  ASSERT_TRUE(id->solution.synchronisation);
  EXPECT_NEAR(id->solution.synchronisation->clock.offset_s, made.clock.offset_s,
              4.0 * id->solution.synchronisation->u_offset_s);
  expect_within_four_u(id->solution.backlash, truth);
}

TEST(BacklashNames, AreReadAsWritten) {
  for (const auto one :
       {TravelDependence::None, TravelDependence::Backlash, TravelDependence::Tables}) {
    EXPECT_EQ(backlash_named(backlash_name(one)), one);
  }
  EXPECT_EQ(backlash_named("some"), std::nullopt);
}

/// Case C of the reference data: caseC_tables.csv and caseC_backlash.csv hold the truth; segments
/// and corner as in ref.json.
class CaseC : public testing::TestWithParam<Estimator> {
 protected:
  void SetUp() override {
    const auto stream = big_file("caseC_stream_noisy.i32"), tables = big_file("caseC_tables.csv"),
               backlash = big_file("caseC_backlash.csv");
    if (!stream || !tables || !backlash) {
      GTEST_SKIP() << "the data of case C are not there: set ABBE_REF_DIR";
    }
    samples_ = read_stream(*stream);
    for (const ReferenceRow& row : read_rows(*tables)) {
      truth_.push_back(row.values.at(row.values.size() - 2));
    }
    backlash_ = read_rows(*backlash);
  }

  [[nodiscard]] Result<Identification> identified(TravelDependence backlash) const {
    Options options;
    options.segment_samples = 20;
    options.corner_m = 0.02;
    options.backlash = backlash;
    options.estimator = GetParam();
    return identify(samples_, case_a_machine(), case_a_path(), {}, options);
  }

  [[nodiscard]] double mean_error_of_grid_m(const VolumetricModel& model) const {
    const Machine machine = case_a_machine();
    const ParameterLayout layout = layout_of(machine);
    std::vector<Vector3> left;
    for (const Vector3& q : tensor_grid(machine.nodes)) {
      left.push_back(model.V_at(q, machine.target_offset_m) -
                     volumetric_error(layout, {truth_.data(), layout.model_size()}, q,
                                      machine.target_offset_m));
    }
    return vector_statistics(left).mean_m;
  }

  std::vector<TrackerObservation> samples_;
  std::vector<double> truth_;
  std::vector<ReferenceRow> backlash_;
};
INSTANTIATE_TEST_SUITE_P(OtfEstimators, CaseC,
                         testing::Values(Estimator::TwoStep, Estimator::Simultaneous));

/// ref.json, cases.C.estimated.mae: 0.347 um with the simultaneous estimator.
TEST_P(CaseC, HasTheErrorOfThePrototypeAndEveryBacklash) {
  const auto id = identified(TravelDependence::Backlash);
  ASSERT_TRUE(id) << id.error().text;
  const double mean_m = mean_error_of_grid_m(id->solution.model);
  RecordProperty("mean_um", std::to_string(1e6 * mean_m));
  EXPECT_LE(mean_m, 0.35e-6);

  ASSERT_EQ(id->solution.backlash.size(), backlash_.size());
  for (std::size_t i = 0; i < backlash_.size(); ++i) {
    const Backlash& b = id->solution.backlash[i];
    EXPECT_EQ(label(b), backlash_[i].label);
    EXPECT_NEAR(b.value, backlash_[i].values.at(0), 4.0 * b.u) << label(b);
  }
}

/// ref.json, cases.C.ignored.mae: 5.949 um with rows of independent noise. Prewhitening
/// (Simultaneous) takes a part of the backlash for correlated noise.
TEST_P(CaseC, IsWrongByMicrometresWithoutBacklash) {
  const auto id = identified(TravelDependence::None);
  ASSERT_TRUE(id) << id.error().text;
  const double mean_m = mean_error_of_grid_m(id->solution.model);
  RecordProperty("mean_um", std::to_string(1e6 * mean_m));
  EXPECT_GT(mean_m, 2e-6);
  if (GetParam() == Estimator::TwoStep) {
    EXPECT_NEAR(mean_m, 5.949e-6, 0.1e-6);
  }
}

}  // namespace
