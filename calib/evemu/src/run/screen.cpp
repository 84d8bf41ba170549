#include "abbe/calib/internal/evemu/run/screen.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::evemu {
namespace {

struct RowsInUse {
  Eigen::Index first, count;
};
/// Range of rows from the first to the last row that is not zero.
RowsInUse rows_in_use(const Eigen::MatrixXd& C) {
  Eigen::Index first = 0, end = C.rows();
  while (first < end && C.row(first).isZero(0.0)) {
    ++first;
  }
  while (end > first && C.row(end - 1).isZero(0.0)) {
    --end;
  }
  return {first, end - first};
}

}  // namespace

Screen::Screen(const Eigen::MatrixXd& X, const Eigen::MatrixXd& S, const Eigen::MatrixXd& A,
               const Eigen::VectorXd& y, const Eigen::VectorXd& prior, double s_m)
    : y_(y), s2_(s_m * s_m) {
  const Eigen::VectorXd root = prior.cwiseSqrt();
  const Eigen::Index n = X.rows(), x = X.cols(), w = S.cols(), m = x + w + A.cols();
  Eigen::MatrixXd U(n + m, m);
  U.topRows(n) << X * root.head(x).asDiagonal(), S * root.tail(w).asDiagonal(), A;
  U.bottomRows(m) = s_m * Eigen::MatrixXd::Identity(m, m);
  Q1_ = (U.householderQr().householderQ() * Eigen::MatrixXd::Identity(n + m, m)).topRows(n);
  Q1_y_ = Q1_.transpose() * y_;
}

Screen::Gain Screen::gain(const Eigen::MatrixXd& C) const {
  const auto [first, count] = rows_in_use(C);
  const auto used = C.middleRows(first, count);
  const Eigen::MatrixXd P = Q1_.middleRows(first, count).transpose() * used;
  const Eigen::MatrixXd GG = (used.transpose() * used - P.transpose() * P) / s2_;
  const Eigen::VectorXd g =
      (used.transpose() * y_.segment(first, count) - P.transpose() * Q1_y_) / s2_;
  Gain best{-std::numeric_limits<double>::infinity(), 0.0};

  for (const double size_m : kSizes_m) {
    // K: covariance of y, N: density of the normal distribution with this covariance, t: prior
    // standard deviation of the coefficients of C:
    //     log N(y; K + t^2 C C^T) - log N(y; K) = g^T M^-1 g t^2 / 2 - log |M| / 2,
    //     M = 1 + t^2 C^T K^-1 C,  g = C^T K^-1 y
    const double t2 = size_m * size_m;
    const Eigen::LLT<Eigen::MatrixXd> M(Eigen::MatrixXd::Identity(GG.rows(), GG.cols()) + t2 * GG);
    const double log_det = 2.0 * M.matrixLLT().diagonal().unaryExpr(&natural_logarithm).sum();
    const double value = 0.5 * (t2 * g.dot(M.solve(g)) - log_det);
    if (M.info() != Eigen::Success || !std::isfinite(value)) {
      return {std::numeric_limits<double>::quiet_NaN(), size_m};
    }
    if (value > best.log_likelihood) {
      best = {value, size_m};
    }
  }

  return best;
}

}  // namespace abbe::calib::evemu
