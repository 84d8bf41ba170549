#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"
#include "repetitions.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using abbe::tests::kAllRepetitions;
using abbe::tests::repetitions;

/// "[w Y' b X Z (C1) t]": the axes in the order from w to t, the first `carried` of them between
/// workpiece and bed.
std::string chain_text(const std::array<char, 3>& order, std::size_t carried) {
  std::string text = "[w ";
  for (std::size_t i = 0; i < order.size(); ++i) {
    text += i == carried ? "b " : "";
    text += order[i];
    text += i < carried ? "' " : " ";
  }
  return text + (carried == order.size() ? "b (C1) t]" : "(C1) t]");
}

TEST(AxisOrders, AreAllReadWithAnyAxesOnTheWorkpieceSide) {
  std::array<char, 3> order{'X', 'Y', 'Z'};
  do {
    for (std::size_t carried = 0; carried <= order.size(); ++carried) {
      const auto chain = KinematicChain::parse(chain_text(order, carried));
      ASSERT_TRUE(chain) << chain.error().text;
      for (std::size_t i = 0; i < order.size(); ++i) {
        EXPECT_EQ(letter(chain->order_w_to_t()[i]), order[i]) << chain->text();
      }
    }
  } while (std::next_permutation(order.begin(), order.end()));
}

class AxisOrder : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Chains, AxisOrder,
                         testing::Values("[w X' b Y Z (C1) t]", "[w Y' b X Z (C1) t]",
                                         "[w b Z X Y (C1) t]", "[w X' Z' b Y (C1) t]",
                                         "[w Y' Z' X' b t]", "[w Z' b Y X (C1) t]"));

TEST_P(AxisOrder, IsIdentifiedExactlyFromExactSamples) {
  MadeRun run = make_run({.noise_factor = 0.0, .in_datum = true, .chain = GetParam()});
  run.options.estimator = Estimator::Simultaneous;
  const auto found = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(found) << found.error().text;
  const auto& statistics = found->solution.statistics;
  EXPECT_EQ(statistics.unknowns - statistics.rank, 20u);
  EXPECT_LT((found->solution.model.U() - run.truth).cwiseAbs().maxCoeff(), 1e-9);
}

/// Mean of (error / standard uncertainty)^2 over independent combinations of the parameters.
struct Normalised {
  double squares = 0.0;
  Eigen::Index combinations = 0;

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
        ++combinations;
      }
    }
  }
};

TEST_P(AxisOrder, HasTheErrorsThatItStates) {
  Normalised all;
  for (unsigned seed = 1; seed <= repetitions(4u); ++seed) {
    const MadeRun run = make_run({.seed = seed,
                                  .noise_seed = seed,
                                  .error_scale_m = 10e-6,
                                  .in_datum = true,
                                  .chain = GetParam()});
    const auto found = identify(run.samples, run.machine, run.path, run.noise, run.options);
    ASSERT_TRUE(found) << found.error().text;
    all.add(found->solution.model, run.truth);
  }

  // chi-square of n combinations: mean 1 after division by n, standard deviation sqrt(2 / n)
  const auto n = static_cast<double>(all.combinations);
  EXPECT_GT(n, kAllRepetitions ? 100.0 : 50.0);
  if (kAllRepetitions) {
    EXPECT_NEAR(all.squares / n, 1.0, 3.0 * std::sqrt(2.0 / n));
  }
}

TEST_P(AxisOrder, IsAcceptedByTheGate) {
  const MadeRun run = make_run({.seed = 3, .chain = GetParam()});
  const auto found = identify(run.samples, run.machine, run.path, run.noise, run.options);
  ASSERT_TRUE(found) << found.error().text;
  const auto verdict = judge(found->observations, found->solution, nullptr, {}, run.options);
  ASSERT_TRUE(verdict) << verdict.error().text;
  EXPECT_TRUE(verdict->accepted) << testing::PrintToString(verdict->reasons);
}

}  // namespace
