#include "abbe/calib/internal/otf/standstill/observe_standstills.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "standstill_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const StandstillRunOptions kShort{.made = {.rate_hz = 100.0}, .positions = 40, .dwell_s = 0.5};

/// The run of a machine that drives through other positions than those of its path.
MadeRun driven_otherwise(const std::function<void(std::vector<Vector3>&)>& change) {
  MadeRun run = make_standstill_run(kShort);
  std::vector<Vector3> driven_m = run.path.vertices_m;
  change(driven_m);
  measure_standstills(run, driven_m, kShort);
  return run;
}

Result<StandstillAssignment> assigned(const MadeRun& run) {
  const auto all = find_standstills(run.samples, run.options.standstill);
  return assign_standstills(all->found, run.machine, run.path, run.options);
}

std::vector<std::string> notes(const MadeRun& run) {
  return observe(run.samples, run.machine, run.path, run.noise, run.options)->notes;
}

TEST(AssignStandstills, FindsPoseAndOrderWithoutKnowingEither) {
  const MadeRun run = make_standstill_run(kShort);
  const auto a = assigned(run);
  ASSERT_TRUE(a) << a.error().text;
  EXPECT_THAT(a->missed, IsEmpty());
  EXPECT_THAT(a->extra, IsEmpty());
  for (std::size_t j = 0; j < 40; ++j) EXPECT_EQ(a->standstill_of[j], j);
  EXPECT_LT((a->T_machine_tracker.t_m - run.T_machine_tracker.t_m).norm(), 1e-3);
}

TEST(AssignStandstills, NamesAPositionThatWasMissed) {
  const MadeRun run = driven_otherwise([](auto& q) { q.erase(q.begin() + 17); });
  EXPECT_THAT(assigned(run)->missed, ElementsAre(17u));
  EXPECT_THAT(notes(run), ElementsAre(HasSubstr("no standstill at position 17, (")));
}

TEST(AssignStandstills, NamesAStandstillThatIsAtNoPosition) {
  const MadeRun run =
      driven_otherwise([](auto& q) { q.insert(q.begin() + 5, Vector3(0.1, 0.1, -0.2)); });
  const auto a = assigned(run);
  ASSERT_EQ(a->extra.size(), 1u);
  EXPECT_EQ(a->extra[0].standstill, 5u);
  EXPECT_EQ(a->standstill_of[5], 6u);
  EXPECT_THAT(notes(run), ElementsAre(HasSubstr("no position of the path")));
}

TEST(AssignStandstills, NamesPositionsThatWereVisitedAgain) {
  const MadeRun run = driven_otherwise([](auto& q) {
    const std::vector<Vector3> again(q.begin() + 20, q.begin() + 22);
    q.insert(q.begin() + 25, again.begin(), again.end());
  });
  EXPECT_THAT(assigned(run)->missed, IsEmpty());
  EXPECT_THAT(notes(run),
              ElementsAre(HasSubstr("again at position 20"), HasSubstr("again at position 21")));
}

TEST(AssignStandstills, FindsTheFirstPositionMissing) {
  const MadeRun run = driven_otherwise([](auto& q) { q.erase(q.begin(), q.begin() + 2); });
  EXPECT_THAT(assigned(run)->missed, ElementsAre(0u, 1u));
}

TEST(AssignStandstills, RefusesARunThatWasStoppedWithThePlace) {
  const MadeRun run = driven_otherwise([](auto& q) { q.resize(30); });
  EXPECT_THAT(assigned(run).error().text,
              testing::AllOf(HasSubstr("10 of 40 positions"), HasSubstr("position 30, (")));
}

TEST(AssignStandstills, RefusesAnotherPathWithTheFirstDifference) {
  MadeRun run = make_standstill_run(kShort);
  std::mt19937_64 random(99);
  run.path.vertices_m = stop_positions(run.machine, 60, random);
  run.path.vertices_m.erase(run.path.vertices_m.begin(), run.path.vertices_m.begin() + 20);
  EXPECT_THAT(assigned(run).error().text,
              testing::AllOf(HasSubstr("do not match"), HasSubstr("position 1, (")));
}

TEST(AssignStandstills, NamesAMirroredPathAndAnotherUnit) {
  MadeRun mirrored = make_standstill_run(kShort), inches = mirrored;
  for (Vector3& q : mirrored.path.vertices_m) q.x() = -q.x();
  for (Vector3& q : inches.path.vertices_m) q /= 25.4;
  EXPECT_THAT(assigned(mirrored).error().text, HasSubstr("they fit with X reversed"));
  EXPECT_THAT(assigned(inches).error().text, HasSubstr("in inch"));
}

TEST(ObserveStandstills, GivesThreeIndependentComponentsPerPosition) {
  const MadeRun run = make_standstill_run(kShort);
  const auto o = observe(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_EQ(o->rows.size(), 120u);
  for (std::size_t i = 0; i < o->rows.size(); i += 3) {
    Matrix3 directions;
    directions << o->rows[i].direction, o->rows[i + 1].direction, o->rows[i + 2].direction;
    EXPECT_LT((directions.transpose() * directions - Matrix3::Identity()).norm(), 1e-12);
    EXPECT_EQ(o->rows[i].axis_position_m, run.path.vertices_m[i / 3]);
    EXPECT_EQ(o->rows[i].leg, i / 3);
  }
}

/// Root mean square of V of the model minus V of the truth, and of its stated uncertainty, rigid
/// motion removed from the first.
double error_left_m(const MadeRun& run, const VolumetricModel& model) {
  std::vector<Vector3> at = tensor_grid(run.machine.nodes);
  for (Vector3& q : at) q += run.machine.target_offset_m;
  return rigid_free(at, errors_left(run, model))->rigid_free.rms_m;
}

TEST(ObserveStandstills, RecoverTheTablesWithoutNoise) {
  const MadeRun run = make_standstill_run(
      {.made = {.noise_factor = 0.0, .rate_hz = 100.0}, .positions = 100, .dwell_s = 0.4});
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  // Second order of the rotation that the alignment removes: (2e-4)^2 times half a metre.
  EXPECT_LT(error_left_m(run, id->solution.model), 0.05e-6);
}

TEST(ObserveStandstills, ReachTheCramerRaoBoundAndStateTheirUncertainty) {
  double squares = 0.0, bound = 0.0, normalised = 0.0;
  constexpr unsigned kSeeds = 10;
  for (unsigned seed = 1; seed <= kSeeds; ++seed) {
    const MadeRun run = make_standstill_run(
        {.made = {.seed = seed, .noise_seed = 50 + seed, .rate_hz = 100.0}, .positions = 200});
    const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
    ASSERT_TRUE(id) << id.error().text;
    const double left_m = error_left_m(run, id->solution.model);
    const double u_m = correction_size(id->solution.model).u_m;
    squares += left_m * left_m;
    bound += u_m * u_m;
    normalised += left_m * left_m / (u_m * u_m) / kSeeds;
  }
  // 1.05 and 0.8 to 1.2 are the requirements; ten runs of 87 parameters scatter by 2 to 3 %.
  EXPECT_LE(std::sqrt(squares / bound), 1.05);
  EXPECT_GE(normalised, 0.8);
  EXPECT_LE(normalised, 1.2);
}

TEST(ObserveStandstills, JudgeAcceptsTheModelAndRefusesAMovedTracker) {
  MadeRun run = make_standstill_run({.made = {.rate_hz = 100.0}, .positions = 100, .dwell_s = 0.5});
  const auto verdict_of = [](const MadeRun& r) {
    const auto id = identify(r.samples, r.machine, r.path, r.noise, r.options);
    return *judge(id->observations, id->solution, nullptr, {}, r.options);
  };
  EXPECT_THAT(verdict_of(run).reasons, IsEmpty());

  for (std::size_t i = run.samples.size() / 2; i < run.samples.size(); ++i) {
    run.samples[i].p_tracker_m += Vector3(30e-6, -20e-6, 10e-6);
  }
  const Verdict moved = verdict_of(run);
  EXPECT_THAT(moved.causes, Contains("moved"));
  EXPECT_THAT(moved.reasons, Contains(HasSubstr("before position")));
}

}  // namespace
