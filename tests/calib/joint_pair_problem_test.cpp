#include "abbe/calib/internal/joint/pair_problem.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <random>
#include <string>
#include <vector>

#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "joint_parts.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::DatumCoordinates;
using abbe::tests::otf::coarse_machine;
using abbe::tests::otf::layout_of;

/// Estimates of the coordinates e of the datum with their covariance, and the effect of an error
/// that parts may share.
struct Estimate {
  Eigen::VectorXd e;
  Eigen::MatrixXd C;  ///< without the effect
  Eigen::VectorXd effect;
};

class PairProblem : public testing::Test {
 protected:
  PairProblem()
      : basis_(*abbe::calib::TableBasis::of(layout_of(coarse_machine("[w X' b Y Z t]")))),
        c_(abbe::calib::datum_coordinates(basis_)),
        m_(c_.N.cols()) {}

  [[nodiscard]] Eigen::VectorXd draw(Eigen::Index size) {
    Eigen::VectorXd values(size);
    for (double& value : values) {
      value = normal_(random_);
    }
    return values;
  }
  [[nodiscard]] Estimate estimate() {
    const Eigen::MatrixXd root = draw(m_ * (m_ + 5)).reshaped(m_, m_ + 5);
    return {draw(m_), 0.2 * root * root.transpose(), draw(m_)};
  }

  /// The part of an estimate; with an empty name the effect is not in it.
  [[nodiscard]] joint::Part part(const Estimate& of, const std::string& effect) const {
    const Eigen::MatrixXd W = of.C.llt().matrixL().solve(Eigen::MatrixXd::Identity(m_, m_));
    const Eigen::Index effects = effect.empty() ? 0 : 1;
    Eigen::MatrixXd A(m_, static_cast<Eigen::Index>(basis_.size()) + effects);
    A.leftCols(c_.N.rows()) = W * c_.N.transpose();
    if (effects > 0) {
      A.rightCols<1>() = W * of.effect;
    }
    abbe::calib::estimation::Information information(static_cast<std::size_t>(A.cols()));
    information.add_rows(A, W * of.e);
    joint::Part made{.name = "part", .method = "test", .information = information};
    if (effects > 0) {
      made.effects = {effect};
    }
    return made;
  }

  /// (e_i - e_j)^T C^-1 (e_i - e_j), C: covariance of the difference.
  static double expected(const Estimate& i, const Estimate& j, const Eigen::MatrixXd& C) {
    const Eigen::VectorXd difference = i.e - j.e;
    return difference.dot(C.llt().solve(difference));
  }

  std::mt19937_64 random_{11};
  std::normal_distribution<double> normal_;
  abbe::calib::TableBasis basis_;
  DatumCoordinates c_;
  Eigen::Index m_ = 0;
};

TEST_F(PairProblem, ComparesAllCoordinatesWithTheCovarianceOfTheirDifference) {
  const Estimate i = estimate(), j = estimate();
  const joint::Part one = part(i, ""), two = part(j, "");
  const joint::Disagreement d = joint::PairProblem(one, two, c_).disagreement();
  const double X2 = expected(i, j, i.C + j.C);
  EXPECT_NEAR(d.statistic, X2, 1e-9 * X2);
  EXPECT_EQ(d.dof, static_cast<std::size_t>(m_));
  EXPECT_NEAR(d.log_p, abbe::calib::log_chi2_tail(X2, d.dof), 1e-6);
}

/// The effect of both is one error: of the difference only the difference of its columns remains.
TEST_F(PairProblem, AnEffectOfBothIsOneError) {
  const Estimate i = estimate(), j = estimate();
  const joint::Part one = part(i, "ranges"), two = part(j, "ranges");
  const joint::Disagreement d = joint::PairProblem(one, two, c_).disagreement();
  const Eigen::VectorXd left = i.effect - j.effect;
  const double X2 = expected(i, j, i.C + j.C + left * left.transpose());
  EXPECT_NEAR(d.statistic, X2, 1e-9 * X2);
  EXPECT_EQ(d.dof, static_cast<std::size_t>(m_));
}

TEST_F(PairProblem, EffectsOfDifferentNamesAreIndependent) {
  const Estimate i = estimate(), j = estimate();
  const joint::Part one = part(i, "ranges of tracker 1"), two = part(j, "ranges of tracker 2");
  const joint::Disagreement d = joint::PairProblem(one, two, c_).disagreement();
  const double X2 =
      expected(i, j, i.C + j.C + i.effect * i.effect.transpose() + j.effect * j.effect.transpose());
  EXPECT_NEAR(d.statistic, X2, 1e-9 * X2);
  EXPECT_EQ(d.dof, static_cast<std::size_t>(m_));
}

/// Without the covariance of one part the statistic of parts that agree would not be chi-square.
TEST_F(PairProblem, OfPartsThatAgreeIsChiSquare) {
  const Estimate i = estimate(), j = estimate();
  const Eigen::MatrixXd root_i = i.C.llt().matrixL(), root_j = j.C.llt().matrixL();
  constexpr int kDraws = 60;
  double mean = 0.0;
  for (int k = 0; k < kDraws; ++k) {
    const Eigen::VectorXd truth = draw(m_);
    const double effect = draw(1)(0);
    const joint::Part one =
                          part({truth + root_i * draw(m_) - i.effect * effect, i.C, i.effect}, "e"),
                      two =
                          part({truth + root_j * draw(m_) - j.effect * effect, j.C, j.effect}, "e");
    mean += joint::PairProblem(one, two, c_).disagreement().statistic / kDraws;
  }
  // chi-square of m degrees of freedom: standard deviation of the mean sqrt(2 m / kDraws)
  const auto m = static_cast<double>(m_);
  EXPECT_NEAR(mean, m, 4.0 * std::sqrt(2.0 * m / kDraws));
}

/// Where a table may differ, the others decide.
TEST_F(PairProblem, FreeingATableLeavesTheRest) {
  const Estimate i = estimate();
  Estimate j = i;
  const auto& group = c_.groups[1];
  j.e.segment(group.first, group.size).array() += 1000.0;
  const joint::Part one = part(i, ""), two = part(j, "");
  Eigen::MatrixXd free = Eigen::MatrixXd::Zero(m_, group.size);
  free.middleRows(group.first, group.size).setIdentity();
  const joint::PairProblem pair(one, two, c_);
  const joint::PairProblem::Freed freed = pair.freed(free);
  EXPECT_GT(pair.disagreement().statistic, 1e4);
  EXPECT_LT(freed.left.statistic, 1e-6);
  EXPECT_EQ(freed.drop_dof, static_cast<std::size_t>(group.size));
  EXPECT_EQ(freed.left.dof, static_cast<std::size_t>(m_ - group.size));
}

}  // namespace
