#include "abbe/calib/internal/estimation/null_space.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Householder>
#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <limits>

#include "column_scale.hpp"

namespace abbe::calib::estimation {
namespace {

Eigen::MatrixXd scaled_R(const Information& data) {
  return data.R() * column_scale(data).asDiagonal();
}

double rounding_of(const Information& data) {
  return static_cast<double>(data.unknowns()) * std::sqrt(static_cast<double>(data.rows())) *
         std::numeric_limits<double>::epsilon();
}

/// Transforms A to an upper bidiagonal matrix with the same singular values ([Golub 2013] section
/// 5.4.8), by one Householder reflection from the left and one from the right for every row.
/// Returns the diagonal d and the elements e beside the diagonal as d_1 e_1 d_2 e_2 .. d_n.
Eigen::VectorXd bidiagonal(Eigen::MatrixXd A) {
  const Eigen::Index n = A.rows();
  Eigen::VectorXd entries(2 * n - 1), work(n), v(n);
  double tau = 0.0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Eigen::Index rest = n - k - 1;
    auto below = v.head(rest);
    A.col(k).tail(rest + 1).makeHouseholder(below, tau, entries(2 * k));
    A.bottomRightCorner(rest + 1, rest).applyHouseholderOnTheLeft(below, tau, work.data());
    if (rest > 0) {
      auto right = v.head(rest - 1);
      A.row(k).tail(rest).transpose().makeHouseholder(right, tau, entries(2 * k + 1));
      A.bottomRightCorner(rest, rest).applyHouseholderOnTheRight(right, tau, work.data());
    }
  }
  return entries;
}

/// Singular values of a square matrix, descending, with an error of eps times the largest. They are
/// the non-negative eigenvalues of the symmetric tridiagonal matrix that has a zero diagonal and
/// bidiagonal(A) beside the diagonal ([Golub 2013] section 8.6.1). The product A^T A, which would
/// lose half of the digits, is not formed. (Eigen 3.4's BDCSVD fails an assertion for some singular
/// matrices; its JacobiSVD is slower.)
Eigen::VectorXd singular_values_of(const Eigen::MatrixXd& A) {
  const Eigen::Index n = A.rows();
  if (n == 0) {
    return {};
  }
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen;
  eigen.computeFromTridiagonal(Eigen::VectorXd::Zero(2 * n), bidiagonal(A), Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().tail(n).reverse().cwiseMax(0.0);
}

/// Singular values that count as zero, relative to the largest.
double zero_of(const Information& data, double zero) {
  return std::max(rounding_of(data), zero);
}

Eigen::ColPivHouseholderQR<Eigen::MatrixXd> pivoted(const Information& data, double zero = 0.0) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled_R(data));
  qr.setThreshold(zero_of(data, zero));
  return qr;
}

}  // namespace

Eigen::VectorXd column_scale(const Information& data) {
  Eigen::VectorXd scale(static_cast<Eigen::Index>(data.unknowns()));
  for (std::size_t i = 0; i < data.unknowns(); ++i) {
    const double squares = data.squared_length(i);
    scale(static_cast<Eigen::Index>(i)) = squares > 0.0 ? 1.0 / std::sqrt(squares) : 1.0;
  }
  return scale;
}

Spectrum spectrum(const Information& data, double zero) {
  Spectrum s;
  s.singular_values = singular_values_of(scaled_R(data));
  const Eigen::Index n = s.singular_values.size();
  if (n == 0) {
    return s;
  }

  s.threshold = zero_of(data, zero) * s.singular_values(0);
  while (static_cast<Eigen::Index>(s.rank) < n &&
         s.singular_values(static_cast<Eigen::Index>(s.rank)) > s.threshold) {
    ++s.rank;
  }

  if (s.rank > 0) {
    s.condition = s.singular_values(0) / s.singular_values(static_cast<Eigen::Index>(s.rank) - 1);
  }

  return s;
}

std::size_t pivoted_rank(const Information& data, double zero) {
  return static_cast<std::size_t>(pivoted(data, zero).rank());
}

NullSpace null_space(const Information& data) {
  return null_space_of_rank(data, pivoted_rank(data));
}

NullSpace null_space_of_rank(const Information& data, std::size_t of_rank) {
  // R P = Q [R11 R12; 0 0], P: permutation, Q: orthogonal. The columns of P [-R11^-1 R12; I] span
  // the null space of R.
  const auto qr = pivoted(data);
  const Eigen::Index n = qr.cols(), rank = static_cast<Eigen::Index>(of_rank);
  if (rank == n) {
    return {.rank = static_cast<std::size_t>(rank),
            .basis = Eigen::MatrixXd(n, 0),
            .share = Eigen::VectorXd::Zero(n)};
  }

  Eigen::MatrixXd null(n, n - rank);
  null.topRows(rank) = -qr.matrixQR()
                            .topLeftCorner(rank, rank)
                            .triangularView<Eigen::Upper>()
                            .solve(qr.matrixQR().topRightCorner(rank, n - rank));
  null.bottomRows(n - rank).setIdentity();
  null = qr.colsPermutation() * null;

  const Eigen::HouseholderQR<Eigen::MatrixXd> orthogonal(null);
  null = orthogonal.householderQ() * Eigen::MatrixXd::Identity(n, n - rank);
  return {.rank = static_cast<std::size_t>(rank),
          .basis = column_scale(data).asDiagonal() * null,
          .share = null.rowwise().squaredNorm()};
}

}  // namespace abbe::calib::estimation
