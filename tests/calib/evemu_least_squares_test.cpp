#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <set>
#include <sstream>
#include <string>

#include "abbe/calib/evemu/solve/noise.hpp"
#include "abbe/calib/internal/evemu/solve/fit_coefficients.hpp"
#include "evemu_study.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;
using testing::HasSubstr;
using testing::Not;

/// Input of least squares for exact observations of the machine of table 3.
struct LeastSquares {
  Observations o;
  ScaledDesign design;
  FitProblem problem;

  explicit LeastSquares(const Layout& layout)
      : o(simulated(layout, table3_machine(), {}, 1)),
        design(*design_of(o)),
        problem(problem_of(o, design, {.estimator = Estimator::Ols})) {}
};

/// Noise of all balls with s = 1: y = L n, C0 = L L^T.
Eigen::MatrixXd noise_root(const LeastSquares& of) {
  const auto rows = of.problem.X.rows();
  return times_noise_root(of.o, Eigen::MatrixXd::Identity(rows, rows)).transpose();
}

TEST(EvemuOls, CovarianceIsThatOfLeastSquaresWithEqualWeights) {
  LeastSquares of(reference_layout());
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 5e-6);
  for (double& y : of.problem.y) {
    y += normal(random);
  }
  const Result<Fit> fit = fit_ols(of.problem);
  ASSERT_TRUE(fit) << fit.error().text;

  const Eigen::MatrixXd K = of.problem.X.completeOrthogonalDecomposition().pseudoInverse();
  const Eigen::MatrixXd root = fit->s_m * K * noise_root(of), C = root * root.transpose();
  const Eigen::VectorXd u = C.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd off = u.asDiagonal() * (fit->covariance_m2 - C) * u.asDiagonal();
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_LT((fit->c_m - K * of.problem.y).norm(), 1e-9 * fit->c_m.norm());
}

/// 200 draws of 147 degrees of freedom: the mean of s^2 scatters by 1 %.
TEST(EvemuOls, NoiseIsUnbiased) {
  LeastSquares of(reference_layout());
  const Eigen::VectorXd exact = of.problem.X * fit_ols(of.problem)->c_m;
  const Eigen::MatrixXd L = noise_root(of);
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  constexpr int kNoiseDraws = 200;
  double mean = 0.0;
  for (int k = 0; k < kNoiseDraws; ++k) {
    Eigen::VectorXd n(L.cols());
    for (double& value : n) {
      value = normal(random);
    }
    of.problem.y = exact + 8e-6 * (L * n);
    mean += std::pow(fit_ols(of.problem)->s_m / 8e-6, 2) / kNoiseDraws;
  }
  EXPECT_NEAR(mean, 1.0, 0.04);
}

/// Coefficients with a share in the combinations that the rows X do not determine.
std::set<std::string> undetermined(const LeastSquares& of) {
  Eigen::MatrixXd X = of.problem.X;
  X.colwise().normalize();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(X, Eigen::ComputeThinV);
  const Eigen::VectorXd s = svd.singularValues();
  std::set<std::string> names;
  for (Eigen::Index k = 0; k < s.size(); ++k) {
    for (Eigen::Index i = 0; s(k) < kUndetermined * s(0) && i < X.cols(); ++i) {
      if (std::abs(svd.matrixV()(i, k)) > 1e-5) {
        names.insert(of.design.equivalent().names()[static_cast<std::size_t>(i)]);
      }
    }
  }
  return names;
}

/// Names behind the last "of ", separated by commas.
std::set<std::string> named_in(const std::string& text) {
  std::set<std::string> names;
  std::istringstream list(text.substr(text.rfind("of ") + 3));
  for (std::string name; std::getline(list, name, ',');) {
    names.insert(name.substr(name.front() == ' ' ? 1 : 0));
  }
  return names;
}

/// Ever flatter layouts: exactly in a plane some columns vanish; nearly in a plane they are small,
/// and only the threshold decides.
TEST(EvemuOls, NamesOnlyCoefficientsThatTheLayoutDoesNotDetermine) {
  std::size_t refused = 0;
  for (const double tilt : {1e-4, 1e-5, 1e-6, 1e-7, 1e-8}) {
    const LeastSquares of(reference_layout(tilt));
    const Result<Fit> fit = fit_ols(of.problem);
    const std::set<std::string> unknown = undetermined(of);
    ASSERT_EQ(fit.has_value(), unknown.empty()) << tilt;
    if (!fit) {
      ++refused;
      EXPECT_EQ(fit.error().code, ErrorCode::RankDeficient);
      EXPECT_THAT(fit.error().text, Not(HasSubstr("datum")));
      const std::set<std::string> named = named_in(fit.error().text);
      EXPECT_FALSE(named.empty());
      for (const std::string& name : named) {
        EXPECT_TRUE(unknown.contains(name)) << name << " at tilt " << tilt;
      }
    }
  }
  EXPECT_GT(refused, 0u);
}

}  // namespace
