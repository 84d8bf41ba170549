#include "abbe/sim/mfb/pattern.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace abbe::sim::mfb {
namespace {

using Eigen::Vector3d;

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

/// Collects the targets of one bar, feature by feature.
class TargetList {
 public:
  explicit TargetList(const Pattern& pattern) : pattern_(pattern) {}

  void hole(std::size_t i) {
    std::size_t k = 0;
    const Vector3d centre_m(pattern_.hole_x_m[i], pattern_.hole_y_m[i], 0.0);
    for (const double z_m : pattern_.hole_levels_m) {
      for (const double angle_deg : pattern_.hole_angles_deg) {
        const double a = kRadPerDeg * angle_deg;
        const Vector3d outwards(std::cos(a), std::sin(a), 0.0);
        list.push_back({{Kind::Hole, i, Side::Left},
                        k++,
                        centre_m + pattern_.hole_radius_m * outwards + Vector3d(0, 0, z_m),
                        -outwards});
      }
    }
  }

  void rod(std::size_t j) {
    std::size_t k = 0;
    const Vector3d centre_m(pattern_.rod_x_m[j], 0.0, 0.0);
    for (const double y_m : pattern_.rod_sections_m) {
      for (const double angle_deg : pattern_.rod_angles_deg) {
        const double a = kRadPerDeg * angle_deg;
        const Vector3d outwards(std::cos(a), 0.0, std::sin(a));
        list.push_back({{Kind::Rod, j, Side::Left},
                        k++,
                        centre_m + pattern_.rod_radius_m * outwards + Vector3d(0, y_m, 0),
                        outwards});
      }
    }
  }

  void plane(std::size_t j, Side side) {
    std::size_t k = 0;
    const double sign = side == Side::Left ? 1.0 : -1.0;
    for (const double dx_m : pattern_.plane_dx_m) {
      for (const double dz_m : pattern_.plane_dz_m) {
        list.push_back({{Kind::Plane, j, side},
                        k++,
                        Vector3d(pattern_.rod_x_m[j] + dx_m, sign * pattern_.plane_y_m, dz_m),
                        sign * Vector3d::UnitY()});
      }
    }
  }

  std::vector<Target> list;

 private:
  const Pattern& pattern_;
};

}  // namespace

Pattern reference_pattern(std::size_t holes, double pitch_m) {
  constexpr double kShift_m = 1e-3;
  // In a bar of 7 holes, hole 5 counted from one end is hole 3 from the other end; so 3 and 4 are
  // used.
  const std::size_t second = holes == 7 ? 3 : 4;
  Pattern pattern;
  for (std::size_t i = 0; i < holes; ++i) {
    pattern.hole_x_m.push_back(static_cast<double>(i) * pitch_m);
    pattern.hole_y_m.push_back(i == 2 || i == second ? kShift_m : 0.0);
    if (i > 0) pattern.rod_x_m.push_back((static_cast<double>(i) - 0.5) * pitch_m);
  }
  return pattern;
}

std::vector<Target> targets(const Pattern& pattern, Probed probed) {
  TargetList all(pattern);
  for (std::size_t i = 0; i < pattern.hole_x_m.size(); ++i) {
    all.hole(i);
    if (i == pattern.rod_x_m.size()) break;
    all.rod(i);
    all.plane(i, Side::Left);
    all.plane(i, Side::Right);
  }

  if (probed == Probed::FromBelow) {
    for (Target& target : all.list) {
      target.place_m.z() *= -1.0;
      target.normal.z() *= -1.0;
    }
  }
  return std::move(all.list);
}

std::string name(const Target& target) {
  const Feature& f = target.feature;
  const std::size_t number = f.index + 1;
  if (f.kind == Kind::Hole) return fmt::format("hole,{},,{}", number, target.k);
  if (f.kind == Kind::Rod) return fmt::format("rod,{},,{}", number, target.k);
  return fmt::format("plane,{},{},{}", number, f.side == Side::Left ? 'L' : 'R', target.k);
}

}  // namespace abbe::sim::mfb
