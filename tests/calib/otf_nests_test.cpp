/// Drift of the tracker, estimated from visits of reference nests together with the errors of the
/// machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/otf/judge/judge.hpp"
#include "nest_run.hpp"
#include "normalised_error.hpp"
#include "repetitions.hpp"
#include "standstill_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

const Vector3 kDrift_m(16e-6, -16e-6, 16e-6);

/// Two nests: translations only, which takes a tenth of the time. `scripts/bench otf_nests` runs
/// more machines, with three nests and rotation, and case A.
NestRunOptions two_nests(NestRunOptions wanted) {
  wanted.nests_m.resize(2);
  return wanted;
}

struct NestResult {
  MadeRun run;
  Identification id;

  [[nodiscard]] double error_m() const { return nest_error_m(run, id.solution.model); }
  [[nodiscard]] const TrackerDrift& drift() const { return *id.solution.drift; }
};

NestResult result_of(const NestRunOptions& wanted) {
  MadeRun run = make_nest_run(wanted);
  Identification id = *identify_nest_run(run);
  return {std::move(run), std::move(id)};
}

/// The machine of most tests, without drift and nests.
double error_without_drift_m() {
  static const double error_m = result_of({.visits = false}).error_m();
  return error_m;
}

/// The same with drift and two nests.
const NestResult& with_drift_and_nests() {
  static const NestResult result = result_of(two_nests({.drift_m = kDrift_m}));
  return result;
}

Verdict verdict_on(const NestResult& result) {
  return *judge(result.id.observations, result.id.solution, nullptr, {}, result.run.options);
}

/// Squares of the errors of the components of V relative to their standard uncertainties.
double mean_normalised(const MadeRun& run, const VolumetricModel& model) {
  constexpr double kFixed_m = 1e-9;  // a component below it is fixed by the datum
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

/// Of three machines: between the 0.1 % and the 99.9 % quantile of chi2/dof for the about 60
/// independent values of each model it would be 0.7 to 1.35; one half more for values that are
/// correlated.
TEST(Nests, DriftRaisesTheErrorByLessThanAFifthAndTheUncertaintyHolds) {
  constexpr unsigned kMachines = abbe::tests::repetitions(3u);
  double with_m = 0.0, without_m = 0.0, normalised = 0.0;
  for (unsigned seed = 1; seed <= kMachines; ++seed) {
    const NestResult with = seed == 1 ? with_drift_and_nests()
                                      : result_of(two_nests({.seed = seed, .drift_m = kDrift_m}));
    with_m += with.error_m();
    const double of_run = mean_normalised(with.run, with.id.solution.model);
    EXPECT_GT(of_run, 0.0);
    EXPECT_LT(of_run, 10.0);
    normalised += of_run / kMachines;
    without_m +=
        seed == 1 ? error_without_drift_m() : result_of({.seed = seed, .visits = false}).error_m();
  }
  if (abbe::tests::kAllRepetitions) {
    EXPECT_LE(with_m, 1.2 * without_m);
    EXPECT_GE(normalised, 0.55);
    EXPECT_LE(normalised, 1.5);
  }
}

TEST(Nests, DriftWithoutNestsSpoilsTheModelAndIsNamed) {
  const NestResult result = result_of({.drift_m = kDrift_m, .visits = false});
  EXPECT_GT(result.error_m(), 2.0 * error_without_drift_m());
  EXPECT_THAT(verdict_on(result).reasons, Contains(HasSubstr("drifts")));
}

TEST(Nests, WithoutDriftTheyHardlyCostAccuracy) {
  EXPECT_LE(result_of(two_nests({})).error_m(), 1.05 * error_without_drift_m());
}

/// A time constant of 600 s is not a draw from the prior: the largest deviation is some um.
TEST(Nests, TheCourseOfTheDriftIsEstimated) {
  const NestRunOptions wanted{.drift_m = kDrift_m};
  const auto& [run, id] = with_drift_and_nests();
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

/// A run whose drift is a random walk of the standard deviation `walk_m` per axis.
NestResult with_random_walk(unsigned seed, const Vector3& walk_m) {
  constexpr double kSteps_hz = 10.0, kRun_s = 1000.0;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> step(0.0, 1.0 / std::sqrt(kSteps_hz * kRun_s));
  std::vector<double> walk{0.0};
  while (walk.size() < 20000) {
    walk.push_back(walk.back() + step(random));
  }
  return result_of(two_nests({.seed = seed, .drift_m = walk_m, .course = [&](double time_s) {
                                return walk[static_cast<std::size_t>(kSteps_hz * time_s)];
                              }}));
}

/// Between the knots the walk is not known: without this part of the covariance the mean is 2.7.
TEST(Nests, TheUncertaintyContainsARandomWalk) {
  double normalised = 0.0;
  for (const unsigned seed : {1u, 2u}) {
    const NestResult result = with_random_walk(seed, kDrift_m);
    normalised += normalised_error_square(result.run, result.id.solution.model) / 2.0;
    EXPECT_GT(result.drift().walk_m, 4e-6);
    EXPECT_THAT(verdict_on(result).notes,
                Contains(HasSubstr("is not smooth: it contains a random")));
  }
  EXPECT_LT(normalised, 1.3);
  EXPECT_GT(normalised, 0.1);
}

TEST(Nests, ASmoothDriftContainsNoRandomWalk) {
  EXPECT_LT(with_drift_and_nests().drift().walk_m, 0.5e-6);
  EXPECT_THAT(verdict_on(with_drift_and_nests()).notes, Not(Contains(HasSubstr("not smooth"))));
}

TEST(Nests, ARotationIsEstimatedFromThreeNestsThatAreNotOnALine) {
  const NestResult result =
      result_of({.drift_m = kDrift_m, .rotation_rad = Vector3(5e-6, -5e-6, 5e-6)});
  EXPECT_TRUE(result.id.observations.drift->rotates);
  EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
}

TEST(Nests, OnALineTheyShowNoRotation) {
  const NestResult result =
      result_of({.drift_m = kDrift_m,
                 .nests_m = {{-0.7, -0.45, -0.5}, {0.0, -0.45, -0.5}, {0.7, -0.45, -0.5}}});
  EXPECT_FALSE(result.id.observations.drift->rotates);
  EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
}

/// On a line: translations only.
NestRunOptions four_nests() {
  return {.drift_m = kDrift_m,
          .nests_m = {
              {-0.7, -0.45, -0.5}, {-0.3, -0.45, -0.5}, {0.3, -0.45, -0.5}, {0.7, -0.45, -0.5}}};
}

TEST(Nests, ABumpedNestIsNamedAndDoesNotSpoilTheModel) {
  NestRunOptions wanted = four_nests();
  wanted.moved = [](auto nest, auto visit) {
    return nest == 1 && visit >= 3 ? Vector3(80e-6, 0.0, 60e-6) : Vector3(Vector3::Zero());
  };
  const NestResult result = result_of(wanted);
  EXPECT_THAT(verdict_on(result).notes,
              Contains(AllOf(HasSubstr("nest B was found"), HasSubstr("moved"))));
  EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
}

TEST(Nests, TwoBumpedNestsAreBothNamed) {
  NestRunOptions wanted = four_nests();
  wanted.moved = [](auto nest, auto visit) {
    return (nest == 0 && visit >= 2) || (nest == 3 && visit >= 4) ? Vector3(0.0, 90e-6, 0.0)
                                                                  : Vector3(Vector3::Zero());
  };
  const NestResult result = result_of(wanted);
  EXPECT_THAT(result.drift().notes,
              UnorderedElementsAre(AllOf(HasSubstr("nest A was found"), HasSubstr("moved")),
                                   AllOf(HasSubstr("nest D was found"), HasSubstr("moved"))));
  EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
}

TEST(Nests, AVisitThatIsWrongIsNamedOnceAndNotUsed) {
  for (const std::size_t wrong : {0, 2}) {
    NestRunOptions wanted = four_nests();
    wanted.moved = [wrong](auto nest, auto visit) {
      return nest == 2 && visit == wrong ? Vector3(0.0, 1e-3, 0.0) : Vector3(Vector3::Zero());
    };
    const NestResult result = result_of(wanted);
    EXPECT_THAT(result.drift().notes,
                ElementsAre(AllOf(HasSubstr("nest C was found"), HasSubstr("not used"))));
    EXPECT_EQ(result.drift().visits + 1, result.id.observations.drift->visits.size());
    EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
  }
}

TEST(Nests, VisitsThatScatterMoreThanStatedCountLess) {
  const NestResult result = result_of(two_nests({.drift_m = kDrift_m, .u_nest_m = 20e-6}));
  EXPECT_GT(result.drift().u_repeatability_m, 8e-6);
  EXPECT_THAT(verdict_on(result).notes, Contains(HasSubstr("scatter more than stated")));
  EXPECT_LE(result.error_m(), 1.5 * error_without_drift_m());
}

TEST(Nests, OneVisitShowsNoDrift) {
  const NestResult result = result_of(two_nests({.every_s = 1e9}));
  EXPECT_FALSE(result.id.solution.drift);
  EXPECT_THAT(result.id.observations.notes,
              Contains(HasSubstr("no reference nest was visited twice")));
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

/// The position of the target in the frame of the tracker, with the machine at a vertex.
Vector3 target_at_m(const MadeRun& run, const Vector3& vertex_m) {
  const RigidTransform& T = run.T_machine_tracker;
  return T.R.transpose() * (vertex_m + run.machine.target_offset_m - T.t_m);
}

TEST(Nests, AtAVertexOfThePathTakeNothingFromTheRun) {
  MadeRun run = with_drift_and_nests().run;
  run.options.nests.nests.push_back(
      {.name = "V",
       .position_tracker_m = target_at_m(run, run.path.vertices_m.front()) + Vector3(0, 0, 4e-3)});
  const auto id = identify_nest_run(run);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_EQ(id->solution.model.U(), with_drift_and_nests().id.solution.model.U());
  EXPECT_THAT(id->observations.notes, Contains(HasSubstr("nest V: the target of the machine")));
}

/// A vertex that the path reaches once.
Vector3 lonely_vertex_m(const Path& path) {
  return *std::find_if(path.vertices_m.begin() + 1, path.vertices_m.end(), [&](const Vector3& v) {
    return std::count(path.vertices_m.begin(), path.vertices_m.end(), v) == 1;
  });
}

/// The beam is broken before and after the vertex: in the stream this is a visit.
TEST(Nests, AtAVertexBetweenTwoBeamBreaksAreNotUsed) {
  MadeRun run = with_drift_and_nests().run;
  const Vector3 at_m = target_at_m(run, lonely_vertex_m(run.path));
  run.options.nests.nests.push_back({.name = "V", .position_tracker_m = at_m});
  for (TrackerObservation& sample : run.samples) {
    const double off_m = (sample.p_tracker_m - at_m).norm();
    sample.valid = sample.valid && (off_m < 1e-3 || off_m > 15e-3);
  }
  const auto id = identify_nest_run(run);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_THAT(id->observations.notes, Contains(HasSubstr("nest V is on leg ")));
  EXPECT_EQ(id->observations.drift->visits.size(), with_drift_and_nests().drift().visits);
}

TEST(Nests, NearThePathAreUsed) {
  MadeRun run = make_nest_run(two_nests({.drift_m = kDrift_m}));
  run.options.nests.nests[0].radius_m = 0.3;  // legs pass through it
  const auto id = identify_nest_run(run);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_EQ(id->solution.model.U(), with_drift_and_nests().id.solution.model.U());
}

/// A run in standstill mode of about 300 s.
NestResult standstills(const NestRunOptions& wanted) {
  MadeRun run = make_standstill_run(
      {.made = {.error_scale_m = 10e-6, .rate_hz = 100.0}, .positions = 80, .dwell_s = 1.0});
  run.samples = with_drift_and_visits(run.samples, wanted, run.noise, run.T_machine_tracker);
  run.options.nests = nest_options(wanted, run.T_machine_tracker);
  Identification id = *identify_nest_run(run);
  return {std::move(run), std::move(id)};
}

TEST(Nests, InStandstillModeTheyShowTheDrift) {
  const NestRunOptions none{.visits = false}, drift{.drift_m = 3.0 * kDrift_m, .visits = false};
  const NestRunOptions nests = two_nests({.drift_m = 3.0 * kDrift_m, .every_s = 40.0});
  const NestResult with_nests = standstills(nests);
  ASSERT_TRUE(with_nests.id.solution.drift);
  EXPECT_GE(with_nests.drift().visits, 8u);
  EXPECT_LE(with_nests.error_m(), 1.3 * standstills(none).error_m());
  EXPECT_GE(standstills(drift).error_m(), 1.5 * with_nests.error_m());
}

TEST(Nests, HeldOutLegsDoNotTakePartInTheDrift) {
  const auto& [run, id] = with_drift_and_nests();
  const Observations without = without_run_effects(id.observations, id.solution);
  const auto fitted_m = held_out(without, nullptr, run.options);
  const auto held =
      held_out(std::span(&without, 1), nullptr, run.options, {}, std::span(&id.solution, 1));
  ASSERT_TRUE(fitted_m && held);
  EXPECT_GT(held->candidate, fitted_m->candidate);
  EXPECT_LT(held->candidate, 1.2);
}

TEST(Nests, TheEstimateOfTheDriftCanBeCancelled) {
  const auto questions = [](MadeRun run, int stop_at) {
    int asked = 0;
    run.options.stopped = [&] { return ++asked == stop_at; };
    const auto id = identify_nest_run(run);
    EXPECT_EQ(id.has_value(), asked != stop_at);
    return asked;
  };
  const int without = questions(make_nest_run({.visits = false}), -1);
  const int with = questions(with_drift_and_nests().run, -1);
  EXPECT_GT(with, without + 10);
  EXPECT_EQ(questions(with_drift_and_nests().run, with), with);  // the last one is of the drift
}

TEST(Nests, NotConfiguredChangeNoBit) {
  const MadeRun run = make_nest_run({.visits = false});
  MadeRun unseen = run;
  unseen.options.nests.nests.push_back({.name = "A", .position_tracker_m = {9.0, 9.0, 9.0}});
  EXPECT_EQ(identify_nest_run(run)->solution.model.U(),
            identify_nest_run(unseen)->solution.model.U());
}

}  // namespace
