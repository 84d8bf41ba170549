#include "abbe/sim/ball_array.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <iterator>
#include <numbers>

#include "abbe/sim/noise.hpp"
#include "units.hpp"

namespace abbe::sim {
namespace {

using Eigen::Vector3d;

constexpr double kUmPerM = 1e6;
constexpr double kReference_C = 20.0;

/// Draws the errors of one array. Each call takes the next random number of the seed.
class ArrayErrors {
 public:
  explicit ArrayErrors(std::uint64_t seed) : seed_(seed) {}
  double number(double u) { return u * gaussian(seed_, NoiseStream::Artefact, next_++); }
  Vector3d vector(double u) {
    const double x = number(u), y = number(u), z = number(u);
    return {x, y, z};
  }

 private:
  std::uint64_t seed_;
  std::uint64_t next_ = 0;
};

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

BallArray true_array(const BallArray& stated, const ArrayState& state) {
  ArrayErrors errors(state.seed);
  BallArray array = stated;
  for (ArrayBall& ball : array.balls) ball.centre_m += errors.vector(state.u_ball_m);

  for (ArrayFace& face : array.faces) {
    // The component of this rotation about the normal has no effect on the plane of the face.
    const Vector3d turn = errors.vector(state.u_block_rad);
    for (Vector3d* direction : {&face.normal, &face.half_1_m, &face.half_2_m})
      *direction = Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()) * *direction;
  }

  const double alpha_per_K = state.alpha_per_K + errors.number(state.u_alpha_per_K);
  const double factor = 1.0 + alpha_per_K * (state.temperature_C - kReference_C);
  for (ArrayBall& ball : array.balls) {
    ball.centre_m *= factor;
    ball.radius_m *= factor;
  }

  for (ArrayFace& face : array.faces) face.centre_m *= factor;
  return array;
}

std::string format_calibrator_toml(const BallArray& array, const ArrayState& state) {
  std::string text = fmt::format("[calibrator]\nname = \"{}\"\ntip_radius_mm = {:.17g}\n",
                                 array.name, kMmPerM * array.tip_radius_m);
  const auto out = std::back_inserter(text);
  if (state.alpha_per_K != 0.0)
    fmt::format_to(out, "alpha_um_per_m_K = {:.17g}\nu_alpha_um_per_m_K = {:.17g}\n",
                   kUmPerM * state.alpha_per_K, kUmPerM * state.u_alpha_per_K);

  for (std::size_t i = 0; i < array.balls.size(); ++i) {
    const Vector3d mm = kMmPerM * array.balls[i].centre_m;
    fmt::format_to(out,
                   "\n[[ball]]\nnumber = {}\nx_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\n"
                   "radius_mm = {:.17g}\nu_um = {:.17g}\n",
                   i + 1, mm.x(), mm.y(), mm.z(), kMmPerM * array.balls[i].radius_m,
                   kUmPerM * state.u_ball_m);
  }

  for (std::size_t i = 0; i < array.faces.size(); ++i) {
    const Vector3d& n = array.faces[i].normal;
    fmt::format_to(
        out, "\n[[block]]\nnumber = {}\nnormal = [{:.17g}, {:.17g}, {:.17g}]\nu_urad = {:.17g}\n",
        i + 1, n.x(), n.y(), n.z(), kUmPerM * state.u_block_rad);
  }

  return text;
}

}  // namespace abbe::sim
