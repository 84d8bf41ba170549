#include "solve/norm_over_balls.hpp"

namespace abbe::calib::evemu {

RigidFreeNorm norm_over_balls(const Observations& o, const ScaledDesign& design) {
  Eigen::MatrixXd B(static_cast<Eigen::Index>(3 * o.rows.size()),
                    static_cast<Eigen::Index>(design.size()));
  std::vector<Vector3> points;
  for (Eigen::Index i = 0; i < std::ssize(o.rows); ++i) {
    points.push_back(o.rows[static_cast<std::size_t>(i)].reading_m);
    B.middleRows<3>(3 * i) = design.B(points.back());
  }
  return {B, points};
}

}  // namespace abbe::calib::evemu
