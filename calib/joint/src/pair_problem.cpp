#include "abbe/calib/internal/joint/pair_problem.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <numeric>

#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "noise_factor.hpp"

namespace abbe::calib::joint {
namespace {

std::vector<std::string> shared_effects(const Part& i, const Part& j) {
  std::vector<std::string> shared;
  for (const std::string& name : i.effects) {
    if (std::find(j.effects.begin(), j.effects.end(), name) != j.effects.end()) {
      shared.push_back(name);
    }
  }
  return shared;
}

}  // namespace

PairProblem::PairProblem(const Part& i, const Part& j, const DatumCoordinates& c)
    : N_(c.N),
      shared_(shared_effects(i, j)),
      i_(in_coordinates(i.information, i.effects, N_, shared_)),
      j_(in_coordinates(j.information, j.effects, N_, shared_)),
      noise_factor_(std::max(variance_may_be(i.dof_of_noise), variance_may_be(j.dof_of_noise))) {}

double PairProblem::squares(const DeterminingRows& i, const DeterminingRows& j) const {
  const Minimum both = minimum(i, j, Eigen::MatrixXd(N_.cols(), 0));
  return (both.sum.rest() + i.rest + j.rest) / noise_factor_;
}

DeterminingRows PairProblem::rows(const Part& part, const estimation::Information& data) const {
  return in_coordinates(data, part.effects, N_, shared_);
}

PairProblem::Minimum PairProblem::minimum(const DeterminingRows& i, const DeterminingRows& j,
                                          const Eigen::MatrixXd& free) const {
  const Eigen::Index m = N_.cols(), known = i.A.cols();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(i.A.rows() + j.A.rows(), known + free.cols());
  A.topLeftCorner(i.A.rows(), known) = i.A;
  A.bottomLeftCorner(j.A.rows(), known) = j.A;
  A.bottomRightCorner(j.A.rows(), free.cols()) = j.A.leftCols(m) * free;
  Eigen::VectorXd z(A.rows());
  z << i.z, j.z;

  Minimum result{estimation::Information(static_cast<std::size_t>(A.cols())), 0};
  result.sum.add_rows(A, z);
  for (Eigen::Index k = m; k < known; ++k) {
    result.sum.add_prior(static_cast<std::size_t>(k), 0.0, 1.0);
  }
  // Rows of rounding errors contain a part of the minimum.
  const DeterminingRows of_sum = determining_rows(result.sum);
  result.sum.add_rest(of_sum.rest - result.sum.rest(), 0);
  result.rank = of_sum.rank();
  return result;
}

Disagreement PairProblem::tested(const Minimum& minimum, std::size_t rows) const {
  Disagreement result{.statistic = minimum.sum.rest() / noise_factor_};
  const std::size_t all = rows + shared_.size();
  result.dof = all - std::min(all, minimum.rank);
  result.log_p = result.dof > 0 ? log_chi2_tail(result.statistic, result.dof) : 0.0;
  return result;
}

Disagreement PairProblem::disagreement(const DeterminingRows& i, const DeterminingRows& j) const {
  return tested(minimum(i, j, Eigen::MatrixXd(N_.cols(), 0)), i.rank() + j.rank());
}

PairProblem::Freed PairProblem::freed(const Eigen::MatrixXd& free) const {
  const std::size_t rows = i_.rank() + j_.rank();
  const Minimum fixed = minimum(i_, j_, Eigen::MatrixXd(N_.cols(), 0));
  const Minimum with = minimum(i_, j_, free);
  Freed result{.left = tested(with, rows)};
  result.drop = std::max(0.0, fixed.sum.rest() - with.sum.rest()) / noise_factor_;
  result.drop_dof = with.rank - std::min(with.rank, fixed.rank);

  if (free.cols() == 0) {
    return result;
  }

  // R of the sum is not pivoted: where both parts leave a combination of e undetermined, its pivot
  // is a rounding error, and the rows below it lack a row of information about d.
  std::vector<std::size_t> all_but_d(with.sum.unknowns() - static_cast<std::size_t>(free.cols()));
  std::iota(all_but_d.begin(), all_but_d.end(), std::size_t{0});
  const estimation::Information of_d = with.sum.without_unknowns(all_but_d);
  const Eigen::MatrixXd R = of_d.R();
  const Eigen::VectorXd z = of_d.z();
  const Eigen::VectorXd length = R.colwise().norm();
  const Eigen::VectorXd scale = length.unaryExpr([](double l) { return l > 0.0 ? 1.0 / l : 1.0; });
  constexpr double kUndetermined = 1e-9;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kUndetermined);
  qr.compute(R * scale.asDiagonal());

  const Eigen::Index rank = qr.rank();
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(free.cols(), rank);
  root.topRows(rank) = qr.matrixQR()
                           .topLeftCorner(rank, rank)
                           .triangularView<Eigen::Upper>()
                           .solve(Eigen::MatrixXd::Identity(rank, rank));
  result.root_cov_d = scale.asDiagonal() * (qr.colsPermutation() * root);
  result.d = result.root_cov_d * (qr.householderQ().adjoint() * z).head(rank);
  return result;
}

}  // namespace abbe::calib::joint
