#include "abbe/calib/internal/mfb/observe/quick_extraction.hpp"

#include <Eigen/Cholesky>
#include <cmath>

namespace abbe::calib::mfb {
namespace {

using Vector5 = Eigen::Matrix<double, 5, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;

/// Axis of the least-squares cylinder, by the steps of fit/cylinder.hpp with normal equations.
/// Their rounding errors do not matter: the iteration ends when the step is zero. Lengths in units
/// of the radius.
PointAndDirection cylinder_axis(std::span<const Vector3> points_m, const PointAndDirection& nominal,
                                double radius_m) {
  constexpr int kMostSteps = 8;
  constexpr double kSettled = 1e-13;
  const double unit = 1.0 / radius_m;
  Vector3 origin = nominal.point, z = nominal.direction;
  double radius = 1.0;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vector3 x = z.unitOrthogonal(), y = z.cross(x);
    Matrix5 H = Matrix5::Zero();
    Vector5 g = Vector5::Zero();
    for (const Vector3& p_m : points_m) {
      const Vector3 from = unit * (p_m - origin);
      const double along = from.dot(z), u = from.dot(x), v = from.dot(y);
      const double distance = std::sqrt(u * u + v * v), c = u / distance, s = v / distance;
      const double row[5] = {-along * s, along * c, c, s, 1.0};
      for (int i = 0; i < 5; ++i) {
        g(i) += row[i] * (distance - radius);
        for (int k = 0; k <= i; ++k) {
          H(i, k) += row[i] * row[k];
        }
      }
    }
    const Vector5 change = H.llt().solve(g);
    origin += radius_m * (change(2) * x + change(3) * y);
    z = (z + change(1) * x - change(0) * y).normalized();
    radius += change(4);
    if (change.cwiseAbs().maxCoeff() < kSettled) {
      break;
    }
  }
  return {origin, z};
}

PointAndDirection plane_through_touches(std::span<const Vector3> points_m, const Vector3& near) {
  Vector3 centroid = Vector3::Zero();
  for (const Vector3& p : points_m) {
    centroid += p / static_cast<double>(points_m.size());
  }
  Matrix3 S = Matrix3::Zero();
  for (const Vector3& p : points_m) {
    const Vector3 c = p - centroid;
    S += c * c.transpose();
  }
  return {centroid, normal_of_scatter(S, near)};
}

}  // namespace

QuickExtraction::QuickExtraction(const TouchPattern& pattern, double tip_radius_m,
                                 std::span<const std::size_t> places) {
  const std::vector<NominalTouch> touches = nominal_touches(pattern, tip_radius_m);
  const Target* before = nullptr;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const NominalTouch& touch = touches[places[i]];
    const Target& t = touch.target;
    auto& groups =
        t.feature == Feature::Hole ? holes_ : (t.feature == Feature::Rod ? rods_ : planes_);
    if (before == nullptr || feature_name(*before) != feature_name(t)) {
      Group& group = groups.emplace_back();
      group.first = i;
      if (t.feature == Feature::Hole) {
        group.nominal = {{pattern.hole_x_m[t.index], pattern.hole_y_m[t.index], 0.0},
                         Vector3::UnitZ()};
        group.radius_m = pattern.hole_radius_m - tip_radius_m;
      } else if (t.feature == Feature::Rod) {
        group.nominal = {{pattern.rod_x_m[t.index], 0.0, 0.0}, Vector3::UnitY()};
        group.radius_m = pattern.rod_radius_m + tip_radius_m;
      } else {
        group.nominal = {touch.tip_m, touch.outward};
      }
    }
    ++groups.back().count;
    before = &touch.target;
  }
  hole_axes_.resize(holes_.size());
  rod_axes_.resize(rods_.size());
  plane_normals_.resize(planes_.size());
}

Result<BarPoints> QuickExtraction::operator()(std::span<const Vector3> tips_m) {
  const auto cylinders = [&](const std::vector<Group>& groups,
                             std::vector<PointAndDirection>& axes) {
    for (std::size_t i = 0; i < groups.size(); ++i) {
      axes[i] = cylinder_axis(tips_m.subspan(groups[i].first, groups[i].count), groups[i].nominal,
                              groups[i].radius_m);
    }
  };
  cylinders(holes_, hole_axes_);
  cylinders(rods_, rod_axes_);
  for (std::size_t j = 0; j < planes_.size(); ++j) {
    plane_normals_[j] = plane_through_touches(tips_m.subspan(planes_[j].first, planes_[j].count),
                                              planes_[j].nominal.direction);
  }
  return bar_points(hole_axes_, rod_axes_, plane_normals_, Vector3::UnitZ());
}

}  // namespace abbe::calib::mfb
