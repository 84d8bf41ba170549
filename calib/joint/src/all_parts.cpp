#include "abbe/calib/internal/joint/all_parts.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "abbe/calib/internal/joint/determining_rows.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "noise_factor.hpp"

namespace abbe::calib::joint {
namespace {

/// Names of the effects that at least two parts have.
std::vector<std::string> shared_effects(std::span<const Part> parts) {
  std::map<std::string, std::size_t> count;
  for (const Part& part : parts) {
    for (const std::string& effect : part.effects) {
      ++count[effect];
    }
  }
  std::vector<std::string> shared;
  for (const auto& [effect, of_parts] : count) {
    if (of_parts > 1) {
      shared.push_back(effect);
    }
  }
  return shared;
}

/// Orthonormal basis of the space that the columns of A span.
Eigen::MatrixXd basis_of_columns(Eigen::MatrixXd A) {
  constexpr double kRounding = 1e-10;  // the same limit as in determining_rows()
  for (auto column : A.colwise()) {
    const double length = column.norm();
    column *= length > 0.0 ? 1.0 / length : 1.0;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kRounding);
  qr.compute(A);
  return qr.householderQ() * Eigen::MatrixXd::Identity(A.rows(), qr.rank());
}

}  // namespace

AllParts::AllParts(std::span<const Part> parts, const DatumCoordinates& c) {
  const std::vector<std::string> shared = shared_effects(parts);
  const Eigen::Index m = c.N.cols(), priors = std::ssize(shared);
  std::vector<DeterminingRows> rows;
  Eigen::Index count = 0;
  for (const Part& part : parts) {
    rows.push_back(in_coordinates(part.information, part.effects, c.N, shared));
    parts_.push_back({rows.back().A.leftCols(m), count, part.dof_of_noise});
    count += rows.back().A.rows();
    noise_factor_ = std::max(noise_factor_, variance_may_be(part.dof_of_noise));
  }

  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(count + priors, m + priors);
  Eigen::VectorXd z = Eigen::VectorXd::Zero(count + priors);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    A.middleRows(parts_[k].first, rows[k].A.rows()) = rows[k].A;
    z.segment(parts_[k].first, rows[k].A.rows()) = rows[k].z;
  }
  A.bottomRightCorner(priors, priors).setIdentity();
  Q_ = basis_of_columns(std::move(A));
  w_ = without_model(z);
}

Eigen::VectorXd AllParts::without_model(const Eigen::VectorXd& rows) const {
  const Eigen::VectorXd along = Q_.transpose() * rows;
  return rows - Q_ * along;
}

std::optional<AllParts::Directed> AllParts::directed(std::size_t part,
                                                     const Eigen::VectorXd& column) const {
  constexpr double kUndetermined = 1e-9;  // relative to the length of the column; below it is
                                          // rounding
  const RowsOfPart& of = parts_[part];
  Eigen::VectorXd a = Eigen::VectorXd::Zero(w_.size());
  a.segment(of.first, of.of_e.rows()) = of.of_e * column;
  const double length = a.norm();
  a = without_model(a);
  const double squares = a.squaredNorm();
  if (!(std::sqrt(squares) > kUndetermined * length)) {
    return std::nullopt;
  }

  Directed result{.d = a.dot(w_) / squares, .u = 1.0 / std::sqrt(squares)};
  double variances = 0.0;  // sum of u_k^4 / dof_k
  for (const RowsOfPart& k : parts_) {
    const double u2 = a.segment(k.first, k.of_e.rows()).squaredNorm() / (squares * squares);
    variances += k.dof_of_noise > 0.0 ? u2 * u2 / k.dof_of_noise : 0.0;
  }
  result.dof = variances > 0.0 ? std::pow(result.u, 4) / variances : 0.0;
  const double drop = result.d * result.d * squares;
  result.log_p = log_chi2_tail(drop / noise_factor_, 1);
  const auto left = static_cast<std::size_t>(w_.size() - Q_.cols() - 1);
  const double X2 = (w_.squaredNorm() - drop) / noise_factor_;
  result.log_p_left = left > 0 ? log_chi2_tail(X2, left) : 0.0;
  return result;
}

}  // namespace abbe::calib::joint
