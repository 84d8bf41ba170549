#include "abbe/calib/internal/estimation/dense_information.hpp"

#include <Eigen/QR>
#include <algorithm>

namespace abbe::calib::estimation {

Information information_of(const Eigen::MatrixXd& A, const Eigen::VectorXd& y) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(A);
  const Eigen::Index m = std::min(A.rows(), A.cols()), outside = A.rows() - m;
  const Eigen::VectorXd turned = qr.householderQ().adjoint() * y;
  const Eigen::MatrixXd R = qr.matrixQR().topRows(m).triangularView<Eigen::Upper>();

  // `information` is empty, so that adding the triangle R changes at most the signs of its rows.
  Information information(static_cast<std::size_t>(A.cols()));
  information.add_rows(R, turned.head(m));
  information.add_rest(turned.tail(outside).squaredNorm(), static_cast<std::size_t>(outside));
  return information;
}

}  // namespace abbe::calib::estimation
