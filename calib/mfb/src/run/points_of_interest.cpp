#include "abbe/calib/mfb/run/points_of_interest.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

/// A vector and its derivatives with respect to the displacement of each touch along its normal.
struct Derived {
  Vector3 value = Vector3::Zero();
  Eigen::Matrix3Xd by_touch;
};

struct AxisOfFeature {
  Derived point, direction;
};

struct PlaneOfFeature {
  Derived point, normal;
};

/// Extends the derivatives D of a and b to all touches. The touches of the feature are the columns
/// from `first` on.
template <class Derivatives>
std::pair<Derived, Derived> derived(const Vector3& a, const Vector3& b, const Derivatives& D,
                                    Eigen::Index first, Eigen::Index touches) {
  Derived da{a, Eigen::Matrix3Xd::Zero(3, touches)}, db{b, Eigen::Matrix3Xd::Zero(3, touches)};
  da.by_touch.middleCols(first, D.cols()) = D.template topRows<3>();
  db.by_touch.middleCols(first, D.cols()) = D.template middleRows<3>(3);
  return {da, db};
}

/// Point at which the axis meets the plane: p + t d with t = n . (c - p) / n . d.
Result<Derived> intersection(const AxisOfFeature& axis, const PlaneOfFeature& plane,
                             const std::string& name) {
  constexpr double kParallel = 0.1;  // sine of the angle between axis and plane
  const Vector3 &p = axis.point.value, &d = axis.direction.value, &n = plane.normal.value;
  const double nd = n.dot(d);
  if (!(std::abs(nd) > kParallel)) {
    return failure(ErrorCode::DegenerateGeometry,
                   message(name, ": the axis is parallel to the plane that it has to meet"));
  }

  const Vector3 to_plane = plane.point.value - p;
  const double t = n.dot(to_plane) / nd;
  const Eigen::RowVectorXd dt =
      ((to_plane - t * d).transpose() * plane.normal.by_touch +
       n.transpose() * (plane.point.by_touch - axis.point.by_touch - t * axis.direction.by_touch)) /
      nd;
  return Derived{p + t * d, axis.point.by_touch + t * axis.direction.by_touch + d * dt};
}

/// Least-squares plane through points; the normal points along `towards`. The normal is the
/// eigenvector of the smallest eigenvalue of M = sum c c^T, and
///     dn = sum over the other eigenvectors v of v (v . dM n) / (lambda_n - lambda_v).
PlaneOfFeature plane_through(const std::vector<Derived>& points, const Vector3& towards) {
  const auto count = static_cast<double>(points.size());
  PlaneOfFeature plane;
  plane.point.by_touch = Eigen::Matrix3Xd::Zero(3, points.front().by_touch.cols());
  for (const Derived& p : points) {
    plane.point.value += p.value / count;
    plane.point.by_touch += p.by_touch / count;
  }

  Matrix3 M = Matrix3::Zero();
  for (const Derived& p : points) {
    const Vector3 c = p.value - plane.point.value;
    M += c * c.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(M);  // in ascending order
  Vector3 n = eigen.eigenvectors().col(0);
  n = n.dot(towards) < 0.0 ? Vector3(-n) : n;

  Eigen::Matrix3Xd dM_n = Eigen::Matrix3Xd::Zero(3, plane.point.by_touch.cols());
  for (const Derived& p : points) {
    const Vector3 c = p.value - plane.point.value;
    const Eigen::Matrix3Xd dc = p.by_touch - plane.point.by_touch;
    dM_n += dc * c.dot(n) + c * (n.transpose() * dc);
  }
  plane.normal = {n, Eigen::Matrix3Xd::Zero(3, dM_n.cols())};
  for (Eigen::Index k = 1; k < 3; ++k) {
    const Vector3 v = eigen.eigenvectors().col(k);
    plane.normal.by_touch +=
        v * (v.transpose() * dM_n) / (eigen.eigenvalues()(0) - eigen.eigenvalues()(k));
  }
  return plane;
}

Eigen::Matrix3Xd cross(const Vector3& a, const Eigen::Matrix3Xd& b) {
  Eigen::Matrix3Xd product(3, b.cols());
  for (Eigen::Index i = 0; i < b.cols(); ++i) {
    product.col(i) = a.cross(Vector3(b.col(i)));
  }
  return product;
}

/// The features of a bar with their derivatives, and the normals of all touches.
class DerivedFeatures {
 public:
  DerivedFeatures(const BarTouches& touches, const BarFeatures& features)
      : touches_(static_cast<Eigen::Index>(touches.count())) {
    for (std::size_t i = 0; i < features.holes.size(); ++i) {
      holes.push_back(axis(features.holes[i], touches.holes_m[i]));
    }
    for (std::size_t j = 0; j < features.rods.size(); ++j) {
      rods.push_back(axis(features.rods[j], touches.rods_m[j]));
    }
    for (std::size_t j = 0; j < features.planes.size(); ++j) {
      const auto& touched = touches.planes_m[j];
      planes.push_back(
          {plane(features.planes[j][0], touched[0]), plane(features.planes[j][1], touched[1])});
    }
  }

  std::vector<AxisOfFeature> holes, rods;
  std::vector<std::array<PlaneOfFeature, 2>> planes;
  std::vector<Vector3> normals;

 private:
  AxisOfFeature axis(const fit::Cylinder& c, const std::vector<Vector3>& points_m) {
    const auto [point, direction] =
        derived(c.point, c.direction, fit::derivatives_by_points(c, points_m), next(), touches_);
    for (const Vector3& p : points_m) {
      const Vector3 from_axis = p - c.point;
      normals.push_back((from_axis - from_axis.dot(c.direction) * c.direction).normalized());
    }
    return {point, direction};
  }
  PlaneOfFeature plane(const fit::Plane& p, const std::vector<Vector3>& points_m) {
    const auto [point, normal] =
        derived(p.point, p.normal, fit::derivatives_by_points(p, points_m), next(), touches_);
    normals.insert(normals.end(), points_m.size(), p.normal);
    return {point, normal};
  }
  [[nodiscard]] Eigen::Index next() const { return std::ssize(normals); }

  Eigen::Index touches_;
};

/// The points PL_j and PR_j of each rod.
Result<std::vector<std::array<Derived, 2>>> ends_of_rods(const DerivedFeatures& f) {
  std::vector<std::array<Derived, 2>> ends;
  for (std::size_t j = 0; j < f.rods.size(); ++j) {
    std::array<Derived, 2>& pair = ends.emplace_back();
    for (std::size_t side = 0; side < 2; ++side) {
      Result<Derived> end =
          intersection(f.rods[j], f.planes[j][side],
                       message(rod_name(j), " and ", plane_name(j, static_cast<Side>(side))));
      ABBE_TRY(end);
      pair[side] = *std::move(end);
    }
  }
  return ends;
}

/// Sets the bar frame and O_i in this frame, with derivatives.
void set_bar_frame(PointsOfInterest& result, const std::vector<Derived>& O, const Derived& z) {
  const Vector3 along = O.back().value - O.front().value;
  const double length_m = along.norm();
  const Vector3 x = along / length_m;
  const Eigen::Matrix3Xd dx = (Matrix3::Identity() - x * x.transpose()) *
                              (O.back().by_touch - O.front().by_touch) / length_m;
  const Vector3 y = z.value.cross(x);
  const Eigen::Matrix3Xd dy = cross(z.value, dx) - cross(x, z.by_touch);
  result.axes << x, y, z.value;

  result.dO_bar_dtouch.resize(3 * std::ssize(O), dx.cols());
  for (std::size_t i = 0; i < O.size(); ++i) {
    const Vector3 from_first = O[i].value - O.front().value;
    const Eigen::Matrix3Xd d = O[i].by_touch - O.front().by_touch;
    auto rows = result.dO_bar_dtouch.middleRows<3>(3 * static_cast<Eigen::Index>(i));
    rows = result.axes.transpose() * d;
    rows.row(0) += from_first.transpose() * dx;
    rows.row(1) += from_first.transpose() * dy;
    rows.row(2) += from_first.transpose() * z.by_touch;
    result.O_bar_m.emplace_back(result.axes.transpose() * from_first);
  }
}

}  // namespace

Result<PointsOfInterest> points_of_interest(const BarTouches& touches, const Matrix3& axes) {
  const Result<BarFeatures> fitted = fit_features(touches, axes);
  ABBE_TRY(fitted);
  DerivedFeatures f(touches, *fitted);
  const auto ends = ends_of_rods(f);
  ABBE_TRY(ends);

  const Vector3 up = axes.col(2);
  const auto& first = ends->front();
  const auto& last = ends->back();
  const PlaneOfFeature reference = plane_through({first[0], first[1], last[0], last[1]}, up);
  PointsOfInterest result;
  std::vector<Derived> O;
  for (std::size_t i = 0; i < f.holes.size(); ++i) {
    const bool at_end = i == 0 || i + 1 == f.holes.size();
    const PlaneOfFeature plane =
        at_end ? reference
               : plane_through({(*ends)[i - 1][0], (*ends)[i - 1][1], (*ends)[i][0], (*ends)[i][1]},
                               up);
    Result<Derived> point = intersection(f.holes[i], plane, hole_name(i));
    ABBE_TRY(point);
    result.O_m.push_back(point->value);
    O.push_back(*std::move(point));
  }

  result.normals = std::move(f.normals);
  result.dO_dtouch.resize(3 * std::ssize(O), static_cast<Eigen::Index>(touches.count()));
  for (std::size_t i = 0; i < O.size(); ++i) {
    result.dO_dtouch.middleRows<3>(3 * static_cast<Eigen::Index>(i)) = O[i].by_touch;
  }
  set_bar_frame(result, O, reference.normal);
  return result;
}

}  // namespace abbe::calib::mfb
