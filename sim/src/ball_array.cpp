#include "abbe/sim/ball_array.hpp"

#include <fmt/format.h>

#include <iterator>
#include <numbers>

#include "units.hpp"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

}  // namespace

BallArray reference_ball_array() {
  BallArray array;
  for (const double x_mm : {0.0, 170.0, 290.0, 410.0, 530.0, 650.0})
    array.balls.push_back({.centre_m = Vector3d(x_mm, 0, 0) / kMmPerM});
  for (const double y_mm : {-65.0, -130.0, -195.0})
    array.balls.push_back({.centre_m = Vector3d(650, y_mm, 0) / kMmPerM});
  array.faces[0] = {.centre_m = Vector3d(60, 0, 25) / kMmPerM,
                    .normal = Vector3d::UnitZ(),
                    .half_1_m = Vector3d(20, 0, 0) / kMmPerM,
                    .half_2_m = Vector3d(0, 20, 0) / kMmPerM};
  array.faces[1] = {.centre_m = Vector3d(100, 25, 0) / kMmPerM,
                    .normal = Vector3d::UnitY(),
                    .half_1_m = Vector3d(10, 0, 0) / kMmPerM,
                    .half_2_m = Vector3d(0, 0, 15) / kMmPerM};
  return array;
}

std::vector<Eigen::Isometry3d> reference_positions() {
  struct Turn {
    double fan_deg, tilt_deg, roll_deg;
  };
  constexpr std::array<Turn, 8> kTurns{{{16.0, 2.1, -4.0},
                                        {11.5, 3.1, 3.0},
                                        {6.5, 1.8, -3.0},
                                        {2.0, 2.6, 5.0},
                                        {15.5, -2.8, 3.5},
                                        {11.0, -1.9, -3.5},
                                        {7.0, -3.0, 2.5},
                                        {1.5, -2.2, -4.5}}};
  constexpr double kRadPerDeg = std::numbers::pi / 180.0;
  std::vector<Eigen::Isometry3d> positions;
  for (const Turn& turn : kTurns) {
    Eigen::Isometry3d& T = positions.emplace_back(Eigen::Isometry3d::Identity());
    T.translate(Vector3d(-90, 140, 30) / kMmPerM);
    T.rotate(Eigen::AngleAxisd(turn.fan_deg * kRadPerDeg, Vector3d::UnitZ()));
    T.rotate(Eigen::AngleAxisd(-turn.tilt_deg * kRadPerDeg, Vector3d::UnitY()));
    T.rotate(Eigen::AngleAxisd(turn.roll_deg * kRadPerDeg, Vector3d::UnitX()));
  }
  return positions;
}

std::string format_calibrator_toml(const BallArray& array) {
  std::string text = fmt::format("[calibrator]\nname = \"{}\"\ntip_radius_mm = {:.17g}\n", array.name,
                                 kMmPerM * array.tip_radius_m);
  const auto out = std::back_inserter(text);
  for (std::size_t i = 0; i < array.balls.size(); ++i) {
    const Vector3d mm = kMmPerM * array.balls[i].centre_m;
    fmt::format_to(out,
                   "\n[[ball]]\nnumber = {}\nx_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\n"
                   "radius_mm = {:.17g}\nu_um = 0\n",
                   i + 1, mm.x(), mm.y(), mm.z(), kMmPerM * array.balls[i].radius_m);
  }
  for (std::size_t i = 0; i < array.faces.size(); ++i) {
    const Vector3d& n = array.faces[i].normal;
    fmt::format_to(out, "\n[[block]]\nnumber = {}\nnormal = [{:.17g}, {:.17g}, {:.17g}]\nu_urad = 0\n", i + 1,
                   n.x(), n.y(), n.z());
  }
  return text;
}

}  // namespace abbe::sim
