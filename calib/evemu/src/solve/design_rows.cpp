#include "abbe/calib/internal/evemu/solve/design_rows.hpp"

#include <Eigen/Dense>

#include "abbe/calib/evemu/solve/noise.hpp"

namespace abbe::calib::evemu {
namespace {

/// Column j: change of a face's fitted normal if the touched points are displaced by function j of
/// the design. The slope of the displacement along the normal changes the normal, and so do
/// displacements along the face of points that do not lie in the fitted plane (a curved V deforms
/// the face).
Eigen::Matrix3Xd normal_change(const fit::Plane& plane, std::span<const Vector3> points_m,
                               const VolumetricDesign& design) {
  Matrix3 spread = Matrix3::Zero();
  Eigen::Matrix3Xd moment = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(design.unknowns));
  const Matrix3 in_plane = Matrix3::Identity() - plane.normal * plane.normal.transpose();

  for (const Vector3& p : points_m) {
    const Vector3 r = in_plane * (p - plane.point);
    const double out_of_plane_m = plane.normal.dot(p - plane.point);
    const Eigen::Matrix3Xd B = design.B(p);
    spread += r * r.transpose() - out_of_plane_m * out_of_plane_m * in_plane;
    moment.noalias() += r * (plane.normal.transpose() * B) + out_of_plane_m * (in_plane * B);
  }

  // `spread` is singular in the direction of the normal, in which the points have no extent. Adding
  // a multiple of n n^T makes the matrix regular without changing the result, because `moment` is
  // zero in this direction.
  spread += spread.trace() * plane.normal * plane.normal.transpose();
  return -spread.ldlt().solve(moment);
}

}  // namespace

Eigen::Matrix3Xd block_rotation(const TouchedArtefact& seen, const VolumetricDesign& design) {
  const Vector3 z = seen.T_self_uni.R.col(2), y = seen.T_self_uni.R.col(1);
  const Vector3 &n1 = seen.blocks[0].normal, &n2 = seen.blocks[1].normal;
  const Eigen::Matrix3Xd dn1 = normal_change(seen.blocks[0], seen.block_points_m[0], design);
  const Eigen::Matrix3Xd dn2 = normal_change(seen.blocks[1], seen.block_points_m[1], design);

  // The axes of the uniform frame are z = n1, which rotates with n1, and x along n2 x z, which
  // rotates with both normals. The rotation of the frame is theta = z x dn1 + z (y . dx).
  const double sine = n2.cross(n1).norm();
  Eigen::Matrix3Xd theta(3, dn1.cols());
  for (Eigen::Index j = 0; j < dn1.cols(); ++j) {
    const Vector3 dz = dn1.col(j), dn2_j = dn2.col(j);
    const Vector3 dx = (dn2_j.cross(z) + n2.cross(dz)) / sine;
    theta.col(j) = z.cross(dz) + z * y.dot(dx);
  }

  return theta;
}

Eigen::Matrix3Xd ball_displacement(const TouchedArtefact& seen, std::size_t ball,
                                   const VolumetricDesign& design) {
  const Vector3& centre = seen.balls[ball].centre;
  const std::vector<Vector3>& points_m = seen.ball_points_m[ball];

  // A displacement delta of a point p changes its residual |p - c| - r by n . delta (c, r: centre
  // and radius, n: outward normal at p). The changes of c and r are the least-squares solution that
  // compensates the changes of all residuals.
  Eigen::MatrixX4d N(static_cast<Eigen::Index>(points_m.size()), 4);
  Eigen::MatrixXd along(N.rows(), static_cast<Eigen::Index>(design.unknowns));
  for (std::size_t k = 0; k < points_m.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const Vector3 n = (points_m[k] - centre).normalized();
    N.row(row) << n.transpose(), 1.0;
    along.row(row) = n.transpose() * design.B(points_m[k]);
  }

  return N.colPivHouseholderQr().solve(along).topRows<3>();
}

Eigen::MatrixXd design_rows(const Observations& o, const VolumetricDesign& design, RowsFrom from) {
  Eigen::MatrixXd X(static_cast<Eigen::Index>(3 * o.rows.size()),
                    static_cast<Eigen::Index>(design.unknowns));
  if (from == RowsFrom::Centres) {
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      X.middleRows<3>(static_cast<Eigen::Index>(3 * i)) = design.B(o.rows[i].reading_m);
    }
    return X;
  }

  Eigen::Index row = 0;
  for (const TouchedArtefact& seen : o.seen) {
    const Eigen::Matrix3Xd theta = block_rotation(seen, design);
    const Vector3& ball1_m = seen.balls.front().centre;
    for (std::size_t b = 0; b < seen.balls.size(); ++b, row += 3) {
      X.middleRows<3>(row) = ball_displacement(seen, b, design) -
                             rotation_effect(seen.balls[b].centre - ball1_m) * theta;
    }
  }

  return X;
}

Eigen::MatrixXd relative_rows(const Observations& o, const VolumetricDesign& design,
                              RowsFrom from) {
  Eigen::MatrixXd X = design_rows(o, design, from);
  const Eigen::Matrix3Xd at_ball1 = design.B(o.ball1_m);
  for (const PositionRows& p : position_rows(o)) {
    const Eigen::Matrix3Xd first = X.middleRows<3>(static_cast<Eigen::Index>(3 * p.ball1));
    for (std::size_t i = p.first; i < p.first + p.count; ++i) {
      const auto row = static_cast<Eigen::Index>(3 * i);
      X.middleRows<3>(row) =
          i == p.ball1 ? at_ball1 : Eigen::Matrix3Xd(X.middleRows<3>(row) - first);
    }
  }
  return X;
}

Eigen::VectorXd observed_m(const Observations& o) {
  Eigen::VectorXd y(static_cast<Eigen::Index>(3 * o.rows.size()));
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    y.segment<3>(static_cast<Eigen::Index>(3 * i)) = o.rows[i].V_m;
  }
  return y;
}

}  // namespace abbe::calib::evemu
