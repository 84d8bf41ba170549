#include "abbe/calib/otf/solve/solve.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "abbe/calib/internal/otf/identify/observe_run.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/judge/judge.hpp"
#include "abbe/calib/otf/observe/observe.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::HasSubstr;

Observations observed(const MadeRun& run) {
  return *observe(run.samples, run.machine, run.path, run.noise, run.options);
}

TEST(Identification, EndsWhenItIsStoppedWhereverItIs) {
  MadeRun run = make_run({});
  int asked = 0, stop_at = -1;
  run.options.stopped = [&] { return asked++ == stop_at; };
  const Observations o = observed(run);
  ASSERT_TRUE(solve(o, run.options));
  const int looks = asked;
  ASSERT_GT(looks, 7);  // one check per update of the alignment, of which there are at least 7

  for (const int at : {0, looks / 2, looks - 1}) {
    asked = 0;
    stop_at = at;
    const auto seen = observe(run.samples, run.machine, run.path, run.noise, run.options);
    const auto error = seen ? solve(*seen, run.options).error() : seen.error();
    EXPECT_THAT(error.text, HasSubstr("stopped before its end")) << stop_at;
  }

  stop_at = 0;
  asked = 0;
  EXPECT_FALSE(held_out(o, nullptr, run.options));
}

TEST(Adjustment, MeetsTheDatumExactlyWhateverItsWeight) {
  const Observations o = observed(make_run({}));
  const RowInformation rows = information_of(o);
  const Adjustment reference = *adjust(rows, o, 1.0);
  const Eigen::MatrixXd K = datum_conditions(ModelDatum::G1, o.basis, o.unknowns());

  for (const double weight : {1e-3, 1e-1, 10.0, 1e3}) {
    const Adjustment a = *adjust(rows, o, weight);
    EXPECT_LT((K * a.U).cwiseAbs().maxCoeff(), 1e-15) << weight;  // rounding of 1e-4
    EXPECT_LT((a.U - reference.U).cwiseAbs().maxCoeff(), 1e-12)
        << weight;  // of 1e-4: rounding x condition
    EXPECT_LT((a.covariance - reference.covariance).cwiseAbs().maxCoeff(),
              1e-6 * reference.covariance.cwiseAbs().maxCoeff())
        << weight;
  }
}

TEST(Adjustment, KnowsRankAndNullSpaceOfTheData) {
  const Observations o = observed(make_run({}));
  const Adjustment a = *adjust(information_of(o), o);
  EXPECT_EQ(a.datum_defect, 20u);
  EXPECT_EQ(a.rank, o.unknowns() - 20);
  EXPECT_GT(a.condition, 1.0);
  EXPECT_LT(a.condition, 1e3);
}

TEST(Adjustment, HasNoUncertaintyWhereTheDatumFixesAValue) {
  const Observations o = observed(make_run({}));
  const Adjustment a = *adjust(information_of(o), o);
  const auto first_straightness =
      static_cast<Eigen::Index>(o.layout().find({Motion::Y, Axis::X})->offset);
  EXPECT_EQ(a.U(first_straightness), 0.0);
  EXPECT_EQ(a.covariance.row(first_straightness).norm(), 0.0);
  EXPECT_GT(a.covariance(first_straightness + 1, first_straightness + 1), 0.0);
}

TEST(Adjustment, HasNoNegativeVarianceWhereRoundingPutsANodeBesideTheReference) {
  for (const auto& [half_m, spacing_m] : {std::pair{0.36, 0.06}, {0.65, 0.05}}) {
    MadeRun run = make_run({});
    const AxisNodes x = *equidistant_nodes(-half_m, half_m, spacing_m);
    std::vector<double> within;
    std::copy_if(x.nodes_m.begin(), x.nodes_m.end(), std::back_inserter(within),
                 [](double node_m) { return std::abs(node_m) < 0.301; });
    run.machine.nodes[0].nodes_m = within;
    const Observations o = observed(run);
    const Adjustment a = *adjust(information_of(o), o);
    EXPECT_GE(a.covariance.diagonal().minCoeff(), 0.0) << half_m;
    EXPECT_TRUE(solve(o, run.options)) << half_m;
  }
}

/// The variance of any weighted least-squares estimate, from its definition: the sandwich formula
/// is valid for wrong weights too.
TEST(Adjustment, StatesTheCovarianceOfWrongWeights) {
  Observations o = observed(make_run({}));
  const Adjustment right = *adjust(information_of(o), o);
  for (Observation& r : o.rows) {
    r.weight *= r.leg % 2 == 0 ? 4.0 : 0.25;
  }

  const Adjustment wrong = *adjust(information_of(o), o);
  // Gauss-Markov: no other weights give a smaller variance, in any direction.
  const Eigen::MatrixXd excess = wrong.covariance - right.covariance;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(excess, Eigen::EigenvaluesOnly);
  EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-9 * eigen.eigenvalues().maxCoeff());
  EXPECT_GT(eigen.eigenvalues().maxCoeff(), 0.0);

  // A common factor of all weights has no effect.
  for (Observation& r : o.rows) {
    r.weight = 7.0 / (r.sigma_m * r.sigma_m);
  }

  EXPECT_TRUE(adjust(information_of(o), o)->covariance.isApprox(right.covariance, 1e-9));
}

/// Same design, new white noise of the stated size, 40 times: k = 2 intervals must hold for 95.45 %
/// of the values.
TEST(Adjustment, UncertaintyCoversTheTruth) {
  MadeRun run = make_run({});
  Observations o = observed(run);
  Eigen::VectorXd with_rigid = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(o.unknowns()));
  with_rigid.head(run.truth.size()) = run.truth;
  const Eigen::VectorXd truth =
      *to_datum(ModelDatum::G1, o.layout(), std::array{o.target_offset_m}, with_rigid);
  std::mt19937_64 random(99);
  std::normal_distribution<double> normal;
  std::size_t inside = 0, all = 0;
  double chi2 = 0.0;

  for (int repeat = 0; repeat < 40; ++repeat) {
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      o.rows[i].y_m = o.rows[i].sigma_m * normal(random);
      for (const SparseRows::Entry& e : o.A.row(i)) {
        o.rows[i].y_m += e.value * truth(static_cast<Eigen::Index>(e.column));
      }
    }

    const Adjustment a = *adjust(information_of(o), o);
    for (Eigen::Index i = 0; i < truth.size(); ++i) {
      if (const double u = std::sqrt(a.covariance(i, i)); u > 0) {
        const double z = (a.U(i) - truth(i)) / u;
        inside += std::abs(z) < 2 ? 1 : 0;
        chi2 += z * z;
        ++all;
      }
    }
  }

  // 40 x about 45 values with strong correlations correspond to a few hundred independent ones: 3
  // standard deviations are 0.04 and 0.2.
  EXPECT_NEAR(static_cast<double>(inside) / static_cast<double>(all), 0.9545, 0.04);
  EXPECT_NEAR(chi2 / static_cast<double>(all), 1.0, 0.2);
}

TEST(Adjustment, NamesNodesWithoutData) {
  MadeRun run = make_run({});
  run.machine.nodes[0].nodes_m.push_back(0.8);
  run.machine.nodes[0].nodes_m.push_back(1.3);  // far beyond the path
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_FALSE(id);
  EXPECT_EQ(id.error().code, ErrorCode::RankDeficient);
  EXPECT_THAT(id.error().text, HasSubstr("EXX at +1.300 m"));
}

TEST(Adjustment, RefusesAPathAlongTheAxesOnly) {
  const MadeRun run = make_run({});
  Observations o = observed(run);
  const RowInformation rows = information_of(o, [&](const Observation& r) {
    const Vector3 d = (run.path.vertices_m[r.leg + 1] - run.path.vertices_m[r.leg]).normalized();
    return d.cwiseAbs().maxCoeff() > 0.999;
  });
  ASSERT_GT(rows.data.rows(), o.unknowns());
  const Result<Adjustment> a = adjust(rows, o);
  ASSERT_FALSE(a);
  EXPECT_EQ(a.error().code, ErrorCode::RankDeficient);
}

class WholeRun : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Chains, WholeRun,
                         testing::Values("[w X' b Y Z t]", "[w b X Z Y t]", "[w Y' X' b Z t]",
                                         "[w b Y Z X t]", "[w b Z X Y t]", "[w Z' b Y X t]"));

// Errors of 30 um over 0.5 m: second-order terms of the alignment stay near 0.01 um.
TEST_P(WholeRun, WithoutNoiseFindsTheMachine) {
  const MadeRun run = make_run({.noise_factor = 0.0, .chain = GetParam()});
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  std::vector<Vector3> points = tensor_grid(run.machine.nodes);
  for (Vector3& p : points) {
    p += run.machine.target_offset_m;
  }
  const ModelDifference left = *rigid_free(points, errors_left(run, id->solution.model));
  EXPECT_LT(left.rigid_free.max_m, 0.1e-6);
}

TEST_P(WholeRun, WithNoiseLeavesNoMoreThanTheNoise) {
  const MadeRun run = make_run({.seed = 4, .chain = GetParam()});
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  const Statistics& s = id->solution.statistics;
  EXPECT_NEAR(s.chi2_per_dof, 1.0, 5 * std::sqrt(2.0 / static_cast<double>(s.degrees_of_freedom)));
  EXPECT_LT(s.after.rms_m, 0.1 * s.before.rms_m);
  EXPECT_EQ(s.degrees_of_freedom, s.observations - s.rank);
}

TEST(WholeRun, BelievesTheStatedUncertaintyWhileTheResidualsAgree) {
  const MadeRun run = make_run({.seed = 4});
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_EQ(id->solution.statistics.variance_factor, 1.0);
}

TEST(WholeRun, WidensTheUncertaintyWhenTheTrackerIsWorseThanStated) {
  const MadeRun stated = make_run({.seed = 4}), worse = make_run({.seed = 4, .noise_factor = 3.0});
  const auto a =
      identify(stated.samples, stated.machine, stated.path, stated.noise, stated.options);
  const auto b = identify(worse.samples, worse.machine, worse.path, worse.noise, worse.options);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(b->solution.statistics.variance_factor, 9.0, 0.5);
  EXPECT_NEAR(b->solution.model.covariance().trace() / a->solution.model.covariance().trace(), 9.0,
              0.5);
}

TEST(WholeRun, KnowsWhatAnErrorAllRangesShareDoesToTheModel) {
  // large compared with second-order terms of the errors, 30 um in 1 m
  constexpr double kScale = 1e-5;
  MadeRun run = make_run({.seed = 5, .noise_factor = 0.0, .error_scale_m = 1e-6});
  const auto right = identify(run.samples, run.machine, run.path, run.noise, run.options);
  run.noise.u_scale = kScale;
  const auto unsure = identify(run.samples, run.machine, run.path, run.noise, run.options);

  for (TrackerObservation& s : run.samples) {
    s.p_tracker_m *= 1.0 + kScale;
  }

  const auto wrong = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(right && unsure && wrong);
  const Eigen::VectorXd moved = wrong->solution.model.U() - right->solution.model.U();
  const Eigen::MatrixXd added =
      unsure->solution.model.covariance() - right->solution.model.covariance();

  // Table by table, in units of the largest: EXX grows by 1e-5 of its axis.
  const double largest_m = moved.cwiseAbs().maxCoeff();
  EXPECT_GT(largest_m, 0.3 * kScale);
  EXPECT_LT((added.diagonal().cwiseMax(0.0).cwiseSqrt() - moved.cwiseAbs()).cwiseAbs().maxCoeff(),
            0.02 * largest_m);
  EXPECT_GT(added(0, 2) * moved(0) * moved(2), -1e-30);  // one cause: fully correlated
}

TEST(WholeRun, GivesTheSameBitsForTheSameInput) {
  const MadeRun run = make_run({.seed = 5});
  const auto first = identify(run.samples, run.machine, run.path, run.noise, run.options);
  const auto second = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->solution.model.U(), second->solution.model.U());
  EXPECT_EQ(first->solution.model.covariance(), second->solution.model.covariance());
}

TEST(WholeRun, SurvivesALostBeam) {
  MadeRun run = make_run({.seed = 6});
  for (std::size_t i = 10000; i < 11500; ++i) {
    run.samples[i].valid = false;
  }
  run.samples.erase(run.samples.begin() + 20000, run.samples.begin() + 20250);
  const auto id = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(id) << id.error().text;
  EXPECT_EQ(id->solution.statistics.lost_samples, 1750u);
  EXPECT_LT(id->solution.statistics.chi2_per_dof, 1.1);
}

TEST(WholeRun, ReportsProgressOfItsStages) {
  MadeRun run = make_run({});
  std::vector<Stage> stages;
  run.options.progress = [&](Stage stage, double fraction) {
    EXPECT_GE(fraction, 0.0);
    EXPECT_LE(fraction, 1.0);
    if (stages.empty() || stages.back() != stage) {
      stages.push_back(stage);
    }
  };
  ASSERT_TRUE(identify(run.samples, run.machine, run.path, run.noise, run.options));
  EXPECT_THAT(stages, testing::ElementsAre(Stage::Align, Stage::Observe, Stage::Solve));
}

}  // namespace
