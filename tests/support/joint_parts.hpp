#pragma once
/// An on-the-fly run and a ball array of one simulated machine, as parts of a joint identification.
/// Deterministic from the seeds.

#include <numbers>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/joint/identify.hpp"
#include "abbe/calib/otf/identify/identify.hpp"
#include "otf_run.hpp"

namespace abbe::tests::joint {

using calib::Vector3;

/// V of a simulated machine.
using Field = std::function<Vector3(const Vector3& reading_m, const Vector3& tool_m)>;

inline Field field_of(const otf::MadeRun& run) {
  return [layout = otf::layout_of(run.machine), truth = run.truth](const Vector3& q_m,
                                                                   const Vector3& tool_m) {
    return calib::volumetric_error(layout, {truth.data(), layout.model_size()}, q_m, tool_m);
  };
}

struct SimulatedArray {
  unsigned seed = 1;
  std::size_t positions = 8;
  double s_m = 1e-6;          ///< noise of a ball centre, per coordinate
  double u_ball_m = 0.5e-6;   ///< errors of the calibrated centres, per coordinate; stated
  double length_error = 0.0;  ///< relative, of all lengths of the array; not stated
  Vector3 tool_m = Vector3::Zero();
};

/// Nine balls in an L: five along x, four along y.
inline std::vector<Vector3> balls_in_array_m() {
  std::vector<Vector3> balls;
  for (int i = 0; i < 5; ++i) {
    balls.emplace_back(0.06 * i, 0.0, 0.0);
  }
  for (int i = 1; i < 5; ++i) {
    balls.emplace_back(0.0, 0.05 * i, 0.0);
  }
  return balls;
}

/// Turned about Ball1 by a full turn in all positions, tilted and rolled by up to 35 degrees.
inline calib::Matrix3 orientation(std::size_t position, std::size_t positions) {
  const double deg = std::numbers::pi / 180.0, k = static_cast<double>(position);
  const double fan = 360.0 * k / static_cast<double>(positions);
  return (Eigen::AngleAxisd(fan * deg, Vector3::UnitZ()) *
          Eigen::AngleAxisd(35.0 * std::sin(1.7 * k + 0.5) * deg, Vector3::UnitY()) *
          Eigen::AngleAxisd(30.0 * std::cos(2.3 * k) * deg, Vector3::UnitX()))
      .toRotationMatrix();
}

/// The errors that the machine observes at the balls. As with the real array the machine places the
/// calibrated balls by what it measures itself: here Ball1 and an orientation wrong by 0.1 mrad.
inline calib::evemu::Observations observed_array(const otf::MadeRun& run, const Field& V,
                                                 const SimulatedArray& wanted) {
  std::mt19937_64 random(wanted.seed);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) {
    const double x = sigma * normal(random), y = sigma * normal(random), z = sigma * normal(random);
    return Vector3(x, y, z);
  };

  const std::vector<Vector3> nominal_m = balls_in_array_m();
  std::vector<Vector3> true_m;
  for (const Vector3& ball : nominal_m) {
    true_m.emplace_back((1.0 + wanted.length_error) * ball + draw(wanted.u_ball_m));
  }

  calib::evemu::Observations o;
  o.machine = {run.machine.chain, wanted.tool_m};
  o.artefact = calib::evemu::ArtefactUncertainty{
      .u_ball_m = std::vector<double>(nominal_m.size(), wanted.u_ball_m)};
  const Vector3 ball1_m(0.01, -0.02, -0.2);
  for (std::size_t p = 0; p < wanted.positions; ++p) {
    const calib::Matrix3 R = orientation(p, wanted.positions);
    calib::evemu::TouchedArtefact seen;
    seen.position = static_cast<int>(p) + 1;
    const Vector3 turned = draw(1e-4);
    Vector3 first = Vector3::Zero();
    for (std::size_t b = 0; b < nominal_m.size(); ++b) {
      const Vector3 place_m = ball1_m + R * true_m[b];
      Vector3 reading_m = place_m;
      for (int i = 0; i < 5; ++i) {
        reading_m = place_m - V(reading_m, wanted.tool_m);
      }
      reading_m += draw(wanted.s_m);
      first = b == 0 ? reading_m : first;
      const Vector3 a_m = R * nominal_m[b];
      seen.ideal_m.emplace_back(first + a_m + turned.cross(a_m));
      seen.balls.push_back({});
      seen.balls.back().centre = reading_m;
      o.rows.push_back({seen.position, static_cast<int>(b) + 1, reading_m,
                        b == 0 ? Vector3(Vector3::Zero()) : Vector3(seen.ideal_m[b] - reading_m)});
    }
    seen.T_self_uni = {R, first};
    o.seen.push_back(std::move(seen));
    o.ball1_m += first / static_cast<double>(wanted.positions);
  }
  return o;
}

inline calib::VolumetricModel model_of(const otf::MadeRun& run) {
  return calib::otf::identify(run.samples, run.machine, run.path, run.noise, run.options)
      ->solution.model;
}

}  // namespace abbe::tests::joint
