#include "abbe/calib/internal/statistics/singular_values.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>

namespace abbe::calib {

Eigen::VectorXd singular_values(const Eigen::MatrixXd& A) {
  if (A.rows() < A.cols()) {
    return singular_values(A.transpose());
  }
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A);
  const Eigen::MatrixXd R = qr.matrixQR().topRows(A.cols()).triangularView<Eigen::Upper>();
  return Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::NoQRPreconditioner>(R).singularValues();
}

}  // namespace abbe::calib
