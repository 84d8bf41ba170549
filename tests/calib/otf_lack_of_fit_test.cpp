#include "abbe/calib/otf/judge/lack_of_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;
using testing::IsEmpty;

Identification identification_of(const MadeRun& run) {
  return *identify(run.samples, run.machine, run.path, run.noise, run.options);
}

std::vector<Alternative> found_in(const MadeRun& run) {
  const Identification id = identification_of(run);
  return *alternatives(id.observations, id.solution, run.options);
}

TEST(LackOfFit, NothingIsFoundInASoundRun) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    EXPECT_THAT(found_in(make_run({.seed = seed, .noise_seed = seed})), IsEmpty());
  }
}

TEST(LackOfFit, WhiteNoiseWidensNoCovariance) {
  const Identification id = identification_of(make_run({}));
  EXPECT_EQ(id.solution.statistics.correlation, 1.0);
  EXPECT_EQ(id.solution.statistics.variance_factor, 1.0);
}

// An autocorrelation of rho from segment to segment divides the information by (1 + rho) / (1 -
// rho).
TEST(LackOfFit, CorrelatedNoiseWidensTheCovariance) {
  MadeRun run = make_run({.noise_factor = 0.0});
  run.options.estimator = Estimator::TwoStep;  // Simultaneous prewhitens
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  const double rho = 0.8,
               keep = std::pow(rho, 1.0 / static_cast<double>(run.options.segment_samples));
  Vector3 noise_m = Vector3::Zero();

  for (TrackerObservation& sample : run.samples) {
    const Vector3 fresh(normal(random), normal(random), normal(random));
    noise_m = keep * noise_m + 3e-6 * std::sqrt(1.0 - keep * keep) * fresh;
    sample.p_tracker_m += noise_m;
  }

  const Statistics s = identification_of(run).solution.statistics;
  EXPECT_NEAR(s.correlation, (1.0 + rho) / (1.0 - rho), 2.5);
  EXPECT_NEAR(s.variance_factor, s.correlation * s.chi2_per_dof, 1e-9 * s.variance_factor);
}

struct Case {
  Cause cause;
  std::string text;  ///< as in the verdict
  std::function<void(MadeRun&)> put_in;
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << name(c.cause);
}

/// The fraction of the run at each sample.
void move_samples(MadeRun& run, const std::function<Vector3(double share, const Vector3&)>& by_m) {
  for (std::size_t i = 0; i < run.samples.size(); ++i) {
    Vector3& p = run.samples[i].p_tracker_m;
    p += by_m(static_cast<double>(i) / static_cast<double>(run.samples.size()), p);
  }
}

const Vector3 kShift_m(30e-6, -20e-6, 10e-6);

class NamedCause : public testing::TestWithParam<Case> {};

TEST_P(NamedCause, IsTheFirstReason) {
  MadeRun run = make_run({});
  GetParam().put_in(run);
  const Identification id = identification_of(run);
  const auto found = alternatives(id.observations, id.solution, run.options);
  ASSERT_TRUE(found) << found.error().text;
  ASSERT_FALSE(found->empty());
  EXPECT_EQ(found->front().cause, GetParam().cause) << found->front().text;
  EXPECT_GT(found->front().bias_m, found->front().u_m);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict);
  EXPECT_FALSE(verdict->accepted);
  EXPECT_THAT(verdict->reasons.front(), HasSubstr(GetParam().text));
}

INSTANTIATE_TEST_SUITE_P(
    LackOfFit, NamedCause,
    testing::Values(
        Case{Cause::Moved, "moved by 37.",
             [](MadeRun& run) {
               move_samples(run, [](double share, const Vector3&) {
                 return share < 0.6 ? Vector3(Vector3::Zero()) : kShift_m;
               });
             }},
        Case{Cause::Drift, "drifts: by 37.",
             [](MadeRun& run) {
               move_samples(run,
                            [](double share, const Vector3&) { return Vector3(share * kShift_m); });
             }},
        Case{Cause::Vertex, "vertex 20 was driven at (",
             [](MadeRun& run) { run.path.vertices_m[20] += Vector3(0.1e-3, 0.1e-3, -0.1e-3); }},
        Case{Cause::RangeOffset, "all ranges of the tracker have an offset of ",
             [](MadeRun& run) {
               move_samples(
                   run, [](double, const Vector3& p) { return Vector3(0.3e-3 * p.normalized()); });
             }},
        Case{Cause::ChainOrder, "from workpiece to tool is XYZ, not ZYX",
             [](MadeRun& run) { run.machine.chain = *KinematicChain::parse("[w b Z Y X t]"); }},
        Case{Cause::NodeSpacing, "too far apart (600 mm)",
             [](MadeRun& run) { run.machine.nodes[0] = *equidistant_nodes(-0.3, 0.3, 0.6); }}));

TEST(LackOfFit, RefusesACorrectionOfTheSizeOfItsUncertainty) {
  MadeRun run = make_run({.error_scale_m = 1e-6});
  run.noise.u_axis_scale = {20e-6, 20e-6, 20e-6};  // 2 K of steel
  const Identification id = identification_of(run);
  const auto verdict = judge(id.observations, id.solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict);
  EXPECT_THAT(verdict->reasons, testing::Contains(HasSubstr("more than half of it")));
}

// The effect of a scale error on V is its relative error times the distance from the reference.
TEST(LackOfFit, ScalesOfTheAxesEnterTheUncertainty) {
  MadeRun run = make_run({});
  const Vector3 q(0.3, 0.0, 0.0), t = run.machine.target_offset_m;
  const double without_m2 = identification_of(run).solution.model.error_at(q, t).cov_V_m2(0, 0);
  run.noise.u_axis_scale = {5e-6, 0.0, 0.0};
  const double with_m2 = identification_of(run).solution.model.error_at(q, t).cov_V_m2(0, 0);
  EXPECT_NEAR(with_m2 - without_m2, 1.5e-6 * 1.5e-6, 1e-16);
}

}  // namespace
