#include "abbe/calib/internal/evemu/solve/artefact_rows.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::evemu {
namespace {

/// Effect of one error of the array on a ball (index from 0), in the uniform frame.
struct Effect {
  ArtefactError error;
  std::function<Vector3(std::size_t ball, const Vector3& from_ball1_m)> on_ball;
};

/// Effect of a rotation d of the uniform frame: the ideal ball centres rotate in the opposite
/// direction.
Effect turned_by(const Vector3& d_rad, ArtefactError error) {
  return {std::move(error),
          [d_rad](std::size_t, const Vector3& a_m) -> Vector3 { return -d_rad.cross(a_m); }};
}

void add_balls(const ArtefactUncertainty& u, std::vector<Effect>& effects) {
  for (std::size_t b = 0; b < u.u_ball_m.size(); ++b) {
    if (u.u_ball_m[b] == 0.0) {
      continue;
    }
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Vector3 delta_m = u.u_ball_m[b] * Vector3::Unit(axis);
      effects.push_back({{message("xyz"[axis], " of ball ", b + 1), u.u_ball_m[b]},
                         [b, delta_m](std::size_t ball, const Vector3&) -> Vector3 {
                           const double share = (ball == b ? 1.0 : 0.0) - (b == 0 ? 1.0 : 0.0);
                           return share * delta_m;
                         }});
    }
  }
}

/// Adds the effects of errors of the block normals n1, n2. The axes x, y, z of uniform_frame() are
/// z = n1, x = n2 x z / sine, so n2 = sine y + cosine z. A change of n1 by e rotates z by z x e,
/// and also rotates x, which is along n2 x n1.
void add_blocks(const ArtefactUncertainty& u, std::vector<Effect>& effects) {
  const double cosine = u.cosine_between_blocks, sine = std::sqrt(1.0 - cosine * cosine);
  const auto& [u1_rad, u2_rad] = u.u_block_rad;
  if (u1_rad > 0.0) {
    effects.push_back(
        turned_by({0.0, u1_rad, u1_rad * cosine / sine}, {"direction of block 1 along x", u1_rad}));
    effects.push_back(turned_by({-u1_rad, 0.0, 0.0}, {"direction of block 1 along y", u1_rad}));
  }
  if (u2_rad > 0.0) {
    effects.push_back(
        turned_by({0.0, 0.0, -u2_rad / sine}, {"direction of block 2 along x", u2_rad}));
  }
}

std::vector<Effect> effects_of(const ArtefactUncertainty& u) {
  std::vector<Effect> effects;
  add_balls(u, effects);
  add_blocks(u, effects);
  if (const double u_scale = u.u_scale(); u_scale > 0.0) {
    effects.push_back({{"length", u_scale}, [u_scale](std::size_t, const Vector3& a_m) -> Vector3 {
                         return u_scale * a_m;
                       }});
  }
  return effects;
}

std::vector<Effect> effects_of(const Observations& o) {
  return o.artefact ? effects_of(*o.artefact) : std::vector<Effect>{};
}

}  // namespace

Eigen::MatrixXd artefact_rows(const Observations& o) {
  const std::vector<Effect> effects = effects_of(o);
  const auto columns = static_cast<Eigen::Index>(effects.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * o.rows.size()), columns);
  Eigen::Index row = 0;

  for (const TouchedArtefact& seen : o.seen) {
    const Matrix3& R = seen.T_self_uni.R;
    for (std::size_t b = 0; b < seen.balls.size(); ++b, row += 3) {
      const Vector3 a_m = R.transpose() * (seen.ideal_m[b] - seen.ideal_m.front());
      for (Eigen::Index k = 0; b > 0 && k < columns; ++k) {
        A.block<3, 1>(row, k) = R * effects[static_cast<std::size_t>(k)].on_ball(b, a_m);
      }
    }
  }

  return A;
}

std::vector<ArtefactError> artefact_errors(const Observations& o) {
  std::vector<ArtefactError> errors;
  for (Effect& effect : effects_of(o)) {
    errors.push_back(std::move(effect.error));
  }
  return errors;
}

}  // namespace abbe::calib::evemu
