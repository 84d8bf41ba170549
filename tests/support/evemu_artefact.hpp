#pragma once
/// Studies of the errors of the ball array itself: possible results of its calibration, and
/// observations made with them.

#include <optional>
#include <random>

#include "evemu_study.hpp"

namespace abbe::tests::evemu {

/// The same array with the given stated uncertainties.
inline calib::evemu::Calibrator stated(calib::evemu::Calibrator c, double u_ball_m,
                                       double u_block_rad) {
  for (auto& ball : c.balls) {
    ball.u_m = u_ball_m;
  }
  for (auto& block : c.blocks) {
    block.u_rad = u_block_rad;
  }
  return c;
}

/// A random result of a calibration with the stated uncertainties.
inline calib::evemu::Calibrator drawn(const calib::evemu::Calibrator& c, double u_scale,
                                      std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  calib::evemu::Calibrator out = c;
  const double scale = 1.0 + u_scale * normal(random);

  for (std::size_t i = 0; i < c.balls.size(); ++i) {
    const Vector3 from_ball1_m = c.balls[i].centre_m - c.balls[0].centre_m;
    const double x = normal(random), y = normal(random), z = normal(random);
    out.balls[i].centre_m =
        c.balls[0].centre_m + scale * from_ball1_m + c.balls[i].u_m * Vector3(x, y, z);
  }

  for (auto& block : out.blocks) {
    const Vector3 n = block.normal.normalized(), a = n.unitOrthogonal(), b = n.cross(a);
    const double along_a = normal(random), along_b = normal(random);
    block.normal = (n + block.u_rad * (along_a * a + along_b * b)).normalized();
  }

  return out;
}

/// Ball centres in the uniform frame of a calibrator: [Li OMM] eq. (11).
inline std::vector<Vector3> in_uniform_frame_m(const calib::evemu::Calibrator& c) {
  const Vector3& ball1_m = c.balls[0].centre_m;
  const calib::Matrix3 R =
      calib::evemu::uniform_frame(ball1_m, c.blocks[0].normal, c.blocks[1].normal)->R;
  std::vector<Vector3> places;
  for (const auto& ball : c.balls) {
    places.emplace_back(R.transpose() * (ball.centre_m - ball1_m));
  }
  return places;
}

/// V at the balls with another calibrator and the same touches: [Li OMM] eq. (12).
inline Eigen::VectorXd errors_with_m(const calib::evemu::Observations& o,
                                     const calib::evemu::Calibrator& c) {
  const std::vector<Vector3> places_m = in_uniform_frame_m(c);
  Eigen::VectorXd V(static_cast<Eigen::Index>(3 * o.rows.size()));
  Eigen::Index row = 0;
  for (const auto& seen : o.seen) {
    for (std::size_t b = 0; b < seen.balls.size(); ++b, row += 3) {
      V.segment<3>(row) = seen.T_self_uni * places_m[b] - seen.balls[b].centre;
    }
  }
  return V;
}

/// The errors of simulated(), evaluated with the calibrator `found` and the uncertainties `u`; the
/// layout is the truth. There are no touched points: rows are computed from centres only.
inline calib::evemu::Observations with_array(calib::evemu::Observations o, const Layout& layout,
                                             const calib::evemu::Calibrator& found,
                                             const calib::evemu::ArtefactUncertainty& u) {
  const std::vector<Vector3> places_m = in_uniform_frame_m(found);
  std::size_t row = 0;
  for (const auto& true_m : layout.true_m) {
    const Vector3 x = (true_m[5] - true_m[0]).normalized(),
                  y = (true_m[5] - true_m[8]).normalized();
    calib::evemu::TouchedArtefact seen;
    seen.position = o.rows[row].position;
    seen.T_self_uni.R << x, y, x.cross(y);
    seen.T_self_uni.t_m = true_m[0];
    seen.ideal_m = true_m;
    for (std::size_t b = 0; b < true_m.size(); ++b, ++row) {
      seen.balls.push_back({.centre = o.rows[row].reading_m, .radius = found.balls[b].radius_m});
      o.rows[row].V_m += seen.T_self_uni.R * places_m[b] - (true_m[b] - true_m[0]);
    }
    o.seen.push_back(std::move(seen));
  }

  o.artefact = u;
  return o;
}

}  // namespace abbe::tests::evemu
