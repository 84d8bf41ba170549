/// Drift of the tracker, estimated from visits of reference nests together with the errors of the
/// machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "abbe/calib/otf/judge.hpp"
#include "nest_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr unsigned kNestRuns = 3;
const Vector3 kDrift_m(16e-6, -16e-6, 16e-6);

double mean_error_of_runs_m(NestRunOptions wanted) {
  double sum_m = 0.0;
  for (wanted.seed = 1; wanted.seed <= kNestRuns; ++wanted.seed) {
    const MadeRun run = make_nest_run(wanted);
    sum_m += nest_error_m(run, identify_nest_run(run)->solution.model);
  }
  return sum_m / kNestRuns;
}

double error_without_drift_m() {
  static const double error_m = mean_error_of_runs_m({.visits = false});
  return error_m;
}

Verdict verdict_on_nest_run(const MadeRun& run) {
  const Identification id = *identify_nest_run(run);
  return *judge(id.observations, id.solution, nullptr, {}, run.options);
}

TEST(Nests, DriftRaisesTheErrorByLessThanAFifth) {
  const double with_nests_m = mean_error_of_runs_m({.drift_m = kDrift_m});
  EXPECT_LE(with_nests_m, 1.2 * error_without_drift_m());
}

TEST(Nests, DriftWithoutNestsSpoilsTheModelAndIsNamed) {
  const NestRunOptions wanted{.drift_m = kDrift_m, .visits = false};
  EXPECT_GT(mean_error_of_runs_m(wanted), 2.0 * error_without_drift_m());
  const Verdict verdict = verdict_on_nest_run(make_nest_run(wanted));
  EXPECT_THAT(verdict.reasons, Contains(HasSubstr("drifts")));
}

TEST(Nests, WithoutDriftTheyHardlyCostAccuracy) {
  EXPECT_LE(mean_error_of_runs_m({}), 1.05 * error_without_drift_m());
}

/// Squares of the errors of the components of V relative to their standard uncertainties.
double mean_normalised(const MadeRun& run, const VolumetricModel& model) {
  constexpr double kFixed_m = 1e-9;  // a component below it is fixed by the gauge
  const std::vector<Vector3> points = tensor_grid(run.machine.nodes);
  const std::vector<Vector3> left_m = errors_left(run, model);
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Matrix3 cov = model.error_at(points[i], run.machine.target_offset_m).cov_V_m2;
    for (Eigen::Index k = 0; k < 3; ++k) {
      if (cov(k, k) > kFixed_m * kFixed_m) {
        sum += left_m[i](k) * left_m[i](k) / cov(k, k);
        count += 1.0;
      }
    }
  }
  return sum / count;
}

/// Of 20 runs: between the 0.1 % and the 99.9 % quantile of chi2/dof for the about 60 independent
/// values of each model it would be 0.88 to 1.13; one half more for values that are correlated.
TEST(Nests, TheStatedUncertaintyHolds) {
  constexpr unsigned kMany = 20;
  double sum = 0.0;
  for (unsigned seed = 1; seed <= kMany; ++seed) {
    const MadeRun run = make_nest_run({.seed = seed, .drift_m = kDrift_m});
    sum += mean_normalised(run, identify_nest_run(run)->solution.model);
  }
  EXPECT_GE(sum / kMany, 0.8);
  EXPECT_LE(sum / kMany, 1.2);
}

/// A time constant of 600 s is not a draw from the prior: the largest deviation is some um.
TEST(Nests, TheCourseOfTheDriftIsEstimated) {
  const NestRunOptions wanted{.drift_m = kDrift_m};
  const MadeRun run = make_nest_run(wanted);
  const Identification id = *identify_nest_run(run);
  ASSERT_TRUE(id.solution.drift);
  const double first_s = id.observations.drift->visits.front().time_s;
  for (const DriftPoint& point : id.solution.drift->points) {
    const Vector3 expected_m =
        run.T_machine_tracker.R * (drift_at(wanted, point.time_s, Vector3::Zero()) -
                                   drift_at(wanted, first_s, Vector3::Zero()));
    for (Eigen::Index k = 0; k < 3; ++k) {
      EXPECT_NEAR(point.value_m(k), expected_m(k), 4e-6) << point.time_s;
    }
  }
}

TEST(Nests, ARotationIsEstimatedFromThreeNestsThatAreNotOnALine) {
  const MadeRun run =
      make_nest_run({.drift_m = kDrift_m, .rotation_rad = Vector3(5e-6, -5e-6, 5e-6)});
  const Identification id = *identify_nest_run(run);
  EXPECT_TRUE(id.observations.drift->rotates);
  EXPECT_LE(nest_error_m(run, id.solution.model), 1.5 * error_without_drift_m());
}

TEST(Nests, OnALineTheyShowNoRotation) {
  const MadeRun run =
      make_nest_run({.drift_m = kDrift_m,
                     .nests_m = {{-0.7, -0.45, -0.5}, {0.0, -0.45, -0.5}, {0.7, -0.45, -0.5}}});
  const Identification id = *identify_nest_run(run);
  EXPECT_FALSE(id.observations.drift->rotates);
  EXPECT_LE(nest_error_m(run, id.solution.model), 1.5 * error_without_drift_m());
}

TEST(Nests, ABumpedNestIsNamedAndDoesNotSpoilTheModel) {
  const MadeRun run = make_nest_run({.drift_m = kDrift_m, .moved = [](auto nest, auto visit) {
                                       return nest == 1 && visit >= 3 ? Vector3(80e-6, 0.0, 60e-6)
                                                                      : Vector3(Vector3::Zero());
                                     }});
  const Verdict verdict = verdict_on_nest_run(run);
  EXPECT_THAT(verdict.notes, Contains(AllOf(HasSubstr("nest B was found"), HasSubstr("moved"))));
  const Identification id = *identify_nest_run(run);
  EXPECT_LE(nest_error_m(run, id.solution.model), 1.5 * error_without_drift_m());
}

TEST(Nests, AVisitThatIsWrongIsNamedAndNotUsed) {
  const MadeRun run = make_nest_run({.drift_m = kDrift_m, .moved = [](auto nest, auto visit) {
                                       return nest == 2 && visit == 2 ? Vector3(0.0, 1e-3, 0.0)
                                                                      : Vector3(Vector3::Zero());
                                     }});
  const Identification id = *identify_nest_run(run);
  EXPECT_THAT(id.solution.drift->notes,
              Contains(AllOf(HasSubstr("nest C was found"), HasSubstr("not used"))));
  EXPECT_EQ(id.solution.drift->visits + 1, id.observations.drift->visits.size());
  EXPECT_LE(nest_error_m(run, id.solution.model), 1.5 * error_without_drift_m());
}

TEST(Nests, VisitsThatScatterMoreThanStatedCountLess) {
  const MadeRun run = make_nest_run({.drift_m = kDrift_m, .u_nest_m = 20e-6});
  const Identification id = *identify_nest_run(run);
  EXPECT_GT(id.solution.drift->u_repeatability_m, 8e-6);
  EXPECT_THAT(verdict_on_nest_run(run).notes, Contains(HasSubstr("scatter more than stated")));
  EXPECT_LE(nest_error_m(run, id.solution.model), 1.5 * error_without_drift_m());
}

TEST(Nests, OneVisitShowsNoDrift) {
  const MadeRun run = make_nest_run({.every_s = 1e9});
  const Identification id = *identify_nest_run(run);
  EXPECT_FALSE(id.solution.drift);
  EXPECT_THAT(id.observations.notes, Contains(HasSubstr("no reference nest was visited twice")));
}

TEST(Nests, AtAWrongPositionAreNamed) {
  MadeRun run = make_nest_run({.drift_m = kDrift_m});
  for (Nest& nest : run.options.nests.nests) {
    nest.position_tracker_m += Vector3(0.0, 0.0, 2.0);
  }
  const auto id = identify_nest_run(run);  // the way to the nests counts as travel of the run
  ASSERT_FALSE(id);
  EXPECT_THAT(id.error().text, HasSubstr("nest A was never measured"));
}

TEST(Nests, ThatTheMachineDrivesThroughAreRefused) {
  MadeRun run = make_nest_run({.nests_m = {{0.0, 0.0, -0.2}, {0.7, -0.45, -0.1}}});
  run.options.nests.nests[0].radius_m = 0.05;
  const auto found = identify_nest_run(run);
  ASSERT_FALSE(found);
  EXPECT_THAT(found.error().text, AllOf(HasSubstr("nest A is "), HasSubstr(" mm from leg ")));
}

TEST(Nests, NotConfiguredChangeNoBit) {
  const MadeRun run = make_nest_run({.visits = false});
  MadeRun unseen = run;
  unseen.options.nests.nests.push_back({.name = "A", .position_tracker_m = {9.0, 9.0, 9.0}});
  EXPECT_EQ(identify_nest_run(run)->solution.model.U(),
            identify_nest_run(unseen)->solution.model.U());
}

}  // namespace
