#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/model/model_drift.hpp"
#include "abbe/calib/model/model_update.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

Result<Identification> identified_cubic(const MadeRun& run) {
  return identify(run.samples, run.machine, run.path, run.noise, run.options);
}

/// At the nodes, where linear and cubic tables have the same V. Without the rigid motion: the datum
/// of the truth is that of linear tables, which differs where the reference is between nodes.
double largest_cubic_error_m(const MadeRun& run, const VolumetricModel& model) {
  std::vector<Vector3> points = tensor_grid(run.machine.nodes);
  for (Vector3& p : points) {
    p += run.machine.target_offset_m;
  }
  return rigid_free(points, errors_left(run, model))->rigid_free.max_m;
}

TEST(CubicTables, AreIdentifiedExactlyFromExactSamples) {
  for (const auto& [chain, kind] :
       {std::pair{"[w X' b Y Z (C1) t]", Interpolation::NaturalCubic},
        std::pair{"[w b Z X Y (C1) t]", Interpolation::NaturalCubic},
        std::pair{"[w X' b Y Z (C1) t]", Interpolation::NotAKnotCubic}}) {
    MadeRun run =
        make_run({.noise_factor = 0.0, .in_datum = true, .chain = chain, .interpolation = kind});
    run.options.estimator = Estimator::Simultaneous;
    const auto found = identified_cubic(run);
    ASSERT_TRUE(found) << found.error().text;
    EXPECT_EQ(found->solution.model.interpolation(), kind);
    EXPECT_EQ(found->solution.statistics.unknowns - found->solution.statistics.rank, 20u);
    EXPECT_LT(largest_cubic_error_m(run, found->solution.model), 1e-9);
  }
}

TEST(CubicTables, OfASmoothMachineAreBetterThanLinearOnes) {
  MadeRun run = make_run({.seed = 2, .interpolation = Interpolation::NaturalCubic});
  const auto cubic = identified_cubic(run);
  run.machine.interpolation = Interpolation::Linear;
  const auto linear = identified_cubic(run);
  ASSERT_TRUE(cubic && linear);
  EXPECT_LT(cubic->solution.statistics.sigma0, 1.1);
  EXPECT_GT(linear->solution.statistics.sigma0, 2.0);
}

TEST(CubicTables, AreAcceptedByTheGate) {
  for (const auto kind : {Interpolation::NaturalCubic, Interpolation::NotAKnotCubic}) {
    const MadeRun run = make_run({.seed = 3, .interpolation = kind});
    const auto found = identified_cubic(run);
    ASSERT_TRUE(found) << found.error().text;
    const auto verdict = judge(found->observations, found->solution, nullptr, {}, run.options);
    ASSERT_TRUE(verdict) << verdict.error().text;
    EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
    EXPECT_LT(verdict->held_out.candidate, 1.1);
    EXPECT_GT(verdict->held_out.observations, verdict->held_out.not_held_out);
  }
}

/// Linear tables leave a part of smooth errors between the nodes: the held-out test prefers cubic.
TEST(CubicTables, WinAgainstAnActiveModelOfLinearOnes) {
  MadeRun run = make_run({.seed = 3, .interpolation = Interpolation::NaturalCubic});
  const auto cubic = identified_cubic(run);
  run.machine.interpolation = Interpolation::Linear;
  const auto linear = identified_cubic(run);
  ASSERT_TRUE(cubic && linear);
  const auto verdict =
      judge(cubic->observations, cubic->solution, &linear->solution.model, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
  ASSERT_TRUE(verdict->held_out.active);
  EXPECT_GT(*verdict->held_out.active, 1.5 * verdict->held_out.candidate);
}

TEST(CubicTables, OfTwoRunsAreTestedForDriftAndJoined) {
  MadeRunOptions made{.seed = 5, .in_datum = true, .interpolation = Interpolation::NaturalCubic};
  const auto first = identified_cubic(make_run(made));
  made.noise_seed = 2;
  const auto second = identified_cubic(make_run(made));
  ASSERT_TRUE(first && second);
  const auto drift = test_drift(second->solution.model, first->solution.model, {});
  ASSERT_TRUE(drift) << drift.error().text;
  EXPECT_FALSE(drift->drifted) << text(*drift);
  const auto joined = update_model(first->solution.model, second->solution.model, {});
  ASSERT_TRUE(joined) << joined.error().text;
  EXPECT_EQ(joined->interpolation(), Interpolation::NaturalCubic);
}

}  // namespace
