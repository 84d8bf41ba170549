#include "abbe/calib/otf/run/two_axis_errors.hpp"

namespace abbe::calib::otf {

Vector3 TwoAxisErrors::products(const MachineNodes& nodes, const Vector3& q_m) {
  Vector3 s;
  for (Eigen::Index a = 0; a < 3; ++a) {
    const std::vector<double>& nodes_m = nodes[static_cast<std::size_t>(a)].nodes_m;
    s(a) = (2.0 * q_m(a) - nodes_m.front() - nodes_m.back()) / (nodes_m.back() - nodes_m.front());
  }
  return {s.x() * s.y(), s.y() * s.z(), s.z() * s.x()};
}

Vector3 TwoAxisErrors::V_m(const MachineNodes& nodes, const Vector3& q_m) const {
  const Vector3 product = products(nodes, q_m);
  Vector3 V_m = Vector3::Zero();
  for (std::size_t pair = 0; pair < 3; ++pair) {
    V_m += product(static_cast<Eigen::Index>(pair)) *
           Vector3(D_m[3 * pair], D_m[3 * pair + 1], D_m[3 * pair + 2]);
  }
  return V_m;
}

Vector3 TwoAxisErrors::rms_m() const {
  constexpr double kMeanSquareOfProduct = 1.0 / 9.0;
  Vector3 squares_m2 = Vector3::Zero();
  for (std::size_t i = 0; i < kTwoAxisErrors; ++i) {
    squares_m2(static_cast<Eigen::Index>(i % 3)) +=
        kMeanSquareOfProduct * (D_m[i] * D_m[i] + u_m[i] * u_m[i]);
  }
  return squares_m2.cwiseSqrt();
}

}  // namespace abbe::calib::otf
