#include "abbe/calib/internal/joint/determining_rows.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <numeric>

namespace abbe::calib::joint {
namespace {

/// 1 / length of every column. A column that consists of rounding errors gets 1 / the longest
/// length; it belongs to an effect that the data cannot separate from the pose of the array.
Eigen::VectorXd inverse_lengths(const Eigen::MatrixXd& R) {
  constexpr double kRounding = 1e-13;
  const Eigen::VectorXd length = R.colwise().norm();
  const double longest = length.size() > 0 ? length.maxCoeff() : 0.0;
  return length.unaryExpr([&](double l) {
    return longest > 0.0 ? 1.0 / (l > kRounding * longest ? l : longest) : 1.0;
  });
}

}  // namespace

DeterminingRows determining_rows(const estimation::Information& data) {
  // Pivots of rounding errors are 1e-13 of the largest or less; a combination with a pivot of 1e-10
  // has an uncertainty that is too large to be useful.
  constexpr double kRounding = 1e-10;
  const Eigen::MatrixXd R = data.R();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  qr.setThreshold(kRounding);
  qr.compute(R * inverse_lengths(R).asDiagonal());

  const Eigen::Index rank = qr.rank();
  Eigen::MatrixXd rows(R.rows(), R.cols() + 1);
  rows << R, data.z();
  rows.applyOnTheLeft(qr.householderQ().adjoint());
  return {rows.topLeftCorner(rank, R.cols()), rows.topRightCorner(rank, 1),
          data.rest() + rows.bottomRightCorner(R.rows() - rank, 1).squaredNorm()};
}

DeterminingRows in_coordinates(const estimation::Information& data,
                               std::span<const std::string> effects, const Eigen::MatrixXd& N,
                               std::span<const std::string> kept) {
  const DeterminingRows rows = determining_rows(data);
  const Eigen::Index m = N.cols(), first_own = m + std::ssize(kept);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(rows.A.rows(), first_own + std::ssize(effects));
  A.leftCols(m) = rows.A.leftCols(N.rows()) * N;

  std::vector<std::size_t> eliminated;
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const auto place = std::find(kept.begin(), kept.end(), effects[k]);
    const auto own = static_cast<std::size_t>(first_own) + k;
    const Eigen::Index column =
        place == kept.end() ? static_cast<Eigen::Index>(own) : m + (place - kept.begin());
    A.col(column) = rows.A.col(N.rows() + static_cast<Eigen::Index>(k));
    eliminated.push_back(own);
  }

  estimation::Information all(static_cast<std::size_t>(A.cols()));
  all.add_rows(A, rows.z);
  for (const std::size_t own : eliminated) {
    all.add_prior(own, 0.0, 1.0);
  }
  DeterminingRows result =
      determining_rows(eliminated.empty() ? all : all.without_unknowns(eliminated));
  result.rest += rows.rest;
  return result;
}

}  // namespace abbe::calib::joint
