#include "abbe/calib/internal/estimation/considered.hpp"

#include <Eigen/Dense>

namespace abbe::calib::estimation {

Eigen::MatrixXd sensitivity(const Information& all, std::size_t estimated) {
  const auto n = static_cast<Eigen::Index>(estimated);
  const Eigen::MatrixXd R = all.R();
  return R.topLeftCorner(n, n).triangularView<Eigen::Upper>().solve(
      R.topRightCorner(n, R.cols() - n));
}

}  // namespace abbe::calib::estimation
