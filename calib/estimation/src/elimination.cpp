#include "elimination.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <limits>

namespace abbe::calib::estimation {

Eliminated eliminate(Eigen::MatrixXd L, const Eigen::MatrixXd& kept) {
  for (Eigen::Index k = 0; k < L.cols(); ++k) {
    if (const double norm = L.col(k).norm(); norm > 0.0) {
      L.col(k) /= norm;
    }
  }

  // The columns of L have unit length. The pivot of a column that depends on the others is a
  // rounding error, at most the number of rows or columns times the machine precision.
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(L);
  qr.setThreshold(static_cast<double>(std::max(L.rows(), L.cols())) *
                  std::numeric_limits<double>::epsilon());
  const Eigen::Index rank = qr.rank();
  Eigen::MatrixXd turned = kept;
  turned.applyOnTheLeft(qr.householderQ().setLength(rank).adjoint());
  return {turned.bottomRows(kept.rows() - rank), rank};
}

}  // namespace abbe::calib::estimation
