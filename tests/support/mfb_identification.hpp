#pragma once
/// The bar, plan and machine of identification_reference.json.

#include <cmath>
#include <numbers>

#include "abbe/calib/mfb/solve/identify.hpp"
#include "mfb_reference.hpp"

namespace abbe::tests::mfb {

/// The pattern of bar.toml: 12 holes, 11 rods, 316 touches.
inline calib::mfb::TouchPattern paper_pattern() {
  calib::mfb::TouchPattern p;
  for (int i = 0; i < 12; ++i) {
    p.hole_x_m.push_back(0.05 * i);
    p.hole_y_m.push_back(i == 2 || i == 4 ? 1e-3 : 0.0);
    if (i < 11) {
      p.rod_x_m.push_back(0.025 + 0.05 * i);
    }
  }
  const auto rad = [](double deg) { return deg * std::numbers::pi / 180.0; };
  p.hole_radius_m = 8e-3;
  p.hole_levels_m = {-6e-3, 6e-3};
  p.hole_angles_rad = {rad(45), rad(135), rad(225), rad(315)};
  p.rod_radius_m = 5e-3;
  p.rod_sections_m = {-12e-3, -4e-3, 4e-3, 12e-3};
  p.rod_angles_rad = {rad(-30), rad(90), rad(210)};
  p.plane_y_m = 18e-3;
  p.plane_dx_m = {-6e-3, 6e-3};
  p.plane_dz_m = {-4e-3, 4e-3};
  return p;
}

/// Standard uncertainties of the calibration: 0.2, 0.35, 0.35 um.
inline Eigen::MatrixXd calibration_m2(std::size_t holes) {
  const auto n = 3 * static_cast<Eigen::Index>(holes);
  Eigen::VectorXd u_m(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    u_m(i) = i % 3 == 0 ? 0.2e-6 : 0.35e-6;
  }
  u_m.head<3>().setZero();
  u_m.tail<2>().setZero();
  return u_m.cwiseAbs2().asDiagonal();
}

inline calib::mfb::Bar bar_with(const std::vector<Vector3>& O_m) {
  calib::mfb::Bar bar{"MFB-1", paper_pattern(), O_m, calibration_m2(O_m.size()), {}, {}};
  bar.O_m.back().tail<2>().setZero();  // 1e-22 in the file
  return bar;
}

/// The 17 measurements of identification_reference.json.
inline calib::mfb::Plan plan_of(const json& reference_case) {
  calib::mfb::Plan plan;
  plan.noise = {.probe_m = 0.125e-6, .machine_m = 0.25e-6};
  for (const json& m : reference_case.at("plan")) {
    calib::mfb::Measurement measurement;
    measurement.name = m.at("name");
    measurement.position = m.at("pos");
    measurement.origin_m = vector_in(m.at("p"), kMm);
    for (int row = 0; row < 3; ++row) {
      measurement.bar_x(row) = m.at("R").at(row).at(0);
      measurement.bar_z(row) = m.at("R").at(row).at(2);
    }
    measurement.tool_offset_m = -vector_in(m.at("J"), kMm);
    plan.measurements.push_back(measurement);
  }
  return plan;
}

/// Axes from 0 to 550 mm, nodes every 50 mm.
inline calib::mfb::MfbMachine paper_machine() {
  const auto nodes = calib::equidistant_nodes(0.0, 0.55);
  return {calib::KinematicChain(), {*nodes, *nodes, *nodes}};
}

}  // namespace abbe::tests::mfb
