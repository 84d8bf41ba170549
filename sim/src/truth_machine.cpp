#include "abbe/sim/truth_machine.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

namespace abbe::sim {
namespace {

Eigen::Vector3d travel_direction(const Squareness& s, Axis axis) {
  switch (axis) {
    case Axis::X:
      return Eigen::Vector3d::UnitX();
    case Axis::Y:
      return Eigen::Vector3d(-s.C0Y_rad, 1.0, 0.0).normalized();
    case Axis::Z:
      return Eigen::Vector3d(s.B0Z_rad, -s.A0Z_rad, 1.0).normalized();
  }
  return Eigen::Vector3d::Zero();
}

Eigen::Isometry3d carriage(const TruthMachine& truth, Axis axis, double q_m,
                           const MachineCondition& condition) {
  const auto a = static_cast<std::size_t>(axis);
  const AxisTruth& errors = truth.axes[a];
  std::array<double, kMotions> e{};

  for (std::size_t i = 0; i < kMotions; ++i) {
    e[i] = errors.error[i].at(q_m) + 0.5 * condition.direction[a] * errors.backlash[i];
  }

  const auto k = static_cast<Eigen::Index>(a);
  e[a] += condition.heat * (truth.thermal.expansion_per_m[k] * q_m + truth.thermal.shift_m[k]);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translate(q_m * travel_direction(truth.squareness, axis));
  T.translate(Eigen::Vector3d(e[0], e[1], e[2]));
  T.rotate(Eigen::AngleAxisd(e[5], Eigen::Vector3d::UnitZ()));
  T.rotate(Eigen::AngleAxisd(e[4], Eigen::Vector3d::UnitY()));
  T.rotate(Eigen::AngleAxisd(e[3], Eigen::Vector3d::UnitX()));

  return T;
}

double sag_at_m(double sag_m, const Eigen::Vector3d& q_m) {
  constexpr double kMiddle_m = 0.25, kWidth_m = 0.15, kRoot = 0.5;
  const double u = (q_m.x() - kMiddle_m) / kWidth_m;
  return sag_m * std::exp(-u * u) * (kRoot + q_m.y());
}

}  // namespace

double ThermalDrift::heat_after(double elapsed_s) const {
  return elapsed_s <= 0.0 ? 0.0 : -std::expm1(-elapsed_s / time_constant_s);
}

Eigen::Vector3d position_m(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                           const MachineCondition& condition) {
  Eigen::Vector3d p = truth.target_offset_m;
  for (auto it = truth.order.rbegin(); it != truth.order.rend(); ++it) {
    p = carriage(truth, *it, q_m[static_cast<Eigen::Index>(*it)], condition) * p;
  }
  if (truth.sag_m != 0.0) p.z() -= sag_at_m(truth.sag_m, q_m);
  return p;
}

Eigen::Vector3d error_m(const TruthMachine& truth, const Eigen::Vector3d& q_m,
                        const MachineCondition& condition) {
  return position_m(truth, q_m, condition) - (q_m + truth.target_offset_m);
}

Result<std::array<Axis, 3>> parse_chain(std::string_view chain) {
  std::vector<Axis> found;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    if (const auto axis = axis_named(chain.substr(i, 1))) found.push_back(*axis);
  }
  std::array<Axis, 3> order{};
  std::vector<Axis> sorted = found;
  std::sort(sorted.begin(), sorted.end());
  if (!std::equal(sorted.begin(), sorted.end(), kAxes.begin(), kAxes.end())) {
    return bad_input("chain \"" + std::string(chain) + "\": X, Y and Z must each appear once");
  }
  std::copy(found.begin(), found.end(), order.begin());
  return order;
}

}  // namespace abbe::sim
