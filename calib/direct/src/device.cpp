#include "device.hpp"

namespace abbe::calib::direct {

Runs at_positions(const Runs& all, const std::function<bool(double position_m)>& keep) {
  std::vector<Eigen::Index> kept;
  Runs out;
  out.left_out = all.left_out;
  for (std::size_t i = 0; i < all.positions_m.size(); ++i) {
    if (keep(all.positions_m[i])) {
      kept.push_back(static_cast<Eigen::Index>(i));
      out.positions_m.push_back(all.positions_m[i]);
    }
  }
  for (const Eigen::VectorXd& run : all.values) {
    out.values.emplace_back(run(kept));
  }
  for (const Eigen::VectorXd& run : all.reversal) {
    out.reversal.emplace_back(run(kept));
  }
  return out;
}

Eigen::MatrixXd covariance_of_device(ErrorMotion motion, const Eigen::MatrixXd& P,
                                     std::span<const double> positions_m,
                                     const DeviceUncertainty& device) {
  const double u = is_rotation(motion.motion) ? device.u_rad : device.u_m;
  Eigen::MatrixXd C = u * u * P * P.transpose();
  if (is_positioning(motion)) {
    const Eigen::Map<const Eigen::VectorXd> p(positions_m.data(), P.cols());
    const Eigen::VectorXd lengths = P * p;
    C += device.u_scale * device.u_scale * lengths * lengths.transpose();
  }
  return C;
}

}  // namespace abbe::calib::direct
