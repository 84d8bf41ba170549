#include "abbe/calib/estimation/information.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "elimination.hpp"
#include "triangle_update.hpp"

namespace abbe::calib::estimation {
namespace {

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Result<void> check_group(const ObservationGroup& b, std::size_t unknowns) {
  const Eigen::Index rows = b.y.size(), columns = std::ssize(b.unknowns);
  const Eigen::Index nuisances = std::ssize(b.u_nuisance);
  const bool sizes = b.A.rows() == rows && b.A.cols() == columns && b.L.cols() == nuisances &&
                     (nuisances == 0 || b.L.rows() == rows) && b.covariance.rows() == rows &&
                     (b.covariance.cols() == rows || b.covariance.cols() == 1);
  if (!sizes) {
    return failure(ErrorCode::BadInput,
                   message("observation group: ", rows, " observations, A ", b.A.rows(), " x ",
                           b.A.cols(), " for ", columns, " unknowns, L ", b.L.rows(), " x ",
                           b.L.cols(), " for ", nuisances, " nuisances, covariance ",
                           b.covariance.rows(), " x ", b.covariance.cols()));
  }

  for (const std::size_t unknown : b.unknowns) {
    if (unknown >= unknowns) {
      return failure(ErrorCode::BadInput,
                     message("observation group: unknown ", unknown, " of ", unknowns));
    }
  }

  for (const double u : b.u_nuisance) {
    if (!(u > 0.0)) {
      return failure(ErrorCode::BadInput, message("observation group: prior uncertainty ", u,
                                                  " of a nuisance must be positive"));
    }
  }

  return {};
}

/// Multiplies the rows by the inverse of a root of their covariance, so that their noise becomes
/// independent with unit variance.
Result<void> whiten(const Eigen::MatrixXd& covariance, Eigen::MatrixXd& rows) {
  if (covariance.cols() == 1) {
    if (!(covariance.minCoeff() > 0.0)) {
      return failure(ErrorCode::DegenerateGeometry,
                     "observation group: a variance is not positive");
    }
    rows.array().colwise() /= covariance.col(0).array().sqrt();
    return {};
  }

  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  if (factor.info() != Eigen::Success) {
    return failure(
        ErrorCode::DegenerateGeometry,
        "observation group: the covariance of the observations is not positive definite");
  }
  factor.matrixL().solveInPlace(rows);
  return {};
}

/// The rows [A y L], followed by one row c_k / u_k = 0 for every nuisance c_k with a prior of
/// standard deviation u_k.
Eigen::MatrixXd with_priors(const Eigen::MatrixXd& rows, const std::vector<double>& u_nuisance) {
  const Eigen::Index first = rows.cols() - std::ssize(u_nuisance);
  const auto priors = std::count_if(u_nuisance.begin(), u_nuisance.end(),
                                    [](double u) { return std::isfinite(u); });
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(rows.rows() + priors, rows.cols());
  all.topRows(rows.rows()) = rows;
  Eigen::Index at = rows.rows();
  for (std::size_t k = 0; k < u_nuisance.size(); ++k) {
    if (std::isfinite(u_nuisance[k])) {
      all(at++, first + static_cast<Eigen::Index>(k)) = 1.0 / u_nuisance[k];
    }
  }
  return all;
}

}  // namespace

Information::Information(std::size_t unknowns)
    : unknowns_(unknowns), values_(unknowns * (unknowns + 1)) {}

Eigen::MatrixXd Information::R() const {
  const auto n = static_cast<Eigen::Index>(unknowns_);
  return Eigen::Map<const RowMajorMatrix>(values_.data(), n, n + 1).leftCols(n);
}

Eigen::VectorXd Information::z() const {
  const auto n = static_cast<Eigen::Index>(unknowns_);
  return Eigen::Map<const RowMajorMatrix>(values_.data(), n, n + 1).col(n);
}

double Information::squared_length(std::size_t unknown) const {
  double squares = 0.0;
  for (std::size_t i = 0; i <= unknown; ++i) {
    squares += row(i)[unknown] * row(i)[unknown];
  }
  return squares;
}

void Information::add_dense(double* rows, std::size_t count) {
  update_triangle(values_.data(), rows, count, unknowns_);
  for (std::size_t i = 0; i < count; ++i) {
    const double residual = rows[i * (unknowns_ + 1) + unknowns_];
    rest_ += residual * residual;
  }
}

void Information::add(RowBatch& batch) {
  add_dense(batch.data(), batch.size());
  rows_ += batch.size();
  batch.clear();
}

void Information::add_rows(const Eigen::MatrixXd& A, const Eigen::VectorXd& y) {
  RowMajorMatrix rows(A.rows(), A.cols() + 1);
  rows << A, y;
  add_dense(rows.data(), static_cast<std::size_t>(rows.rows()));
  rows_ += static_cast<std::size_t>(rows.rows());
}

Result<void> Information::add(const ObservationGroup& group) {
  if (Result<void> valid = check_group(group, unknowns_); !valid) {
    return valid;
  }

  const Eigen::Index columns = group.A.cols(), nuisances = group.L.cols();
  Eigen::MatrixXd all(group.A.rows(), columns + 1 + nuisances);
  all.leftCols(columns) = group.A;
  all.col(columns) = group.y;
  if (nuisances > 0) {
    all.rightCols(nuisances) = group.L;
  }

  if (Result<void> done = whiten(group.covariance, all); !done) {
    return done;
  }

  Eigen::MatrixXd rows = all.leftCols(columns + 1);
  if (nuisances > 0) {
    const Eigen::MatrixXd with = with_priors(all, group.u_nuisance);
    rows = eliminate(with.rightCols(nuisances), with.leftCols(columns + 1)).rows;
  }

  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows.rows(), static_cast<Eigen::Index>(unknowns_));
  for (Eigen::Index k = 0; k < columns; ++k) {
    A.col(static_cast<Eigen::Index>(group.unknowns[static_cast<std::size_t>(k)])) += rows.col(k);
  }
  add_rows(A, rows.col(columns));
  return {};
}

void Information::add_prior(std::size_t unknown, double value, double u) {
  RowBatch batch(unknowns_);
  const RowEntry entry{unknown, 1.0};
  batch.append(std::span(&entry, 1), value, 1.0 / u);
  add(batch);
}

Information& Information::operator+=(const Information& other) {
  std::vector<double> rows = other.values_;
  add_dense(rows.data(), unknowns_);
  rest_ += other.rest_;
  rows_ += other.rows_;
  return *this;
}

void Information::add(const Information& part, std::span<const std::size_t> at) {
  std::vector<double> rows(part.unknowns_ * (unknowns_ + 1));
  for (std::size_t i = 0; i < part.unknowns_; ++i) {
    double* to = rows.data() + i * (unknowns_ + 1);
    for (std::size_t k = i; k < part.unknowns_; ++k) {
      to[at[k]] = part.row(i)[k];
    }
    to[unknowns_] = part.row(i)[part.unknowns_];
  }

  add_dense(rows.data(), part.unknowns_);
  rest_ += part.rest_;
  rows_ += part.rows_;
}

void Information::forget(double factor) {
  const double root = std::sqrt(factor);
  for (double& value : values_) {
    value *= root;
  }
  rest_ *= factor;
}

Information Information::without_unknowns(std::span<const std::size_t> eliminated) const {
  std::vector<Eigen::Index> out, kept;
  for (std::size_t i = 0; i < unknowns_; ++i) {
    const bool is_out = std::find(eliminated.begin(), eliminated.end(), i) != eliminated.end();
    (is_out ? out : kept).push_back(static_cast<Eigen::Index>(i));
  }

  const Eigen::MatrixXd R = this->R();
  Eigen::MatrixXd others(R.rows(), std::ssize(kept) + 1);
  others << R(Eigen::all, kept), z();
  const Eliminated rest = eliminate(R(Eigen::all, out), others);

  Information result(kept.size());
  result.add_rows(rest.rows.leftCols(std::ssize(kept)), rest.rows.rightCols<1>());
  result.rest_ += rest_;
  result.rows_ = rows_ - std::min(rows_, static_cast<std::size_t>(rest.rank));
  return result;
}

}  // namespace abbe::calib::estimation
