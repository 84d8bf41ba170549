#include "abbe/calib/mfb/run/bar.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr std::size_t kPlanesOfRod = 2;

void append_hole(std::vector<NominalTouch>& all, const TouchPattern& p, std::size_t i,
                 double tip_radius_m) {
  const Vector3 middle(p.hole_x_m[i], p.hole_y_m[i], 0.0);
  std::size_t k = 0;
  for (const double level_m : p.hole_levels_m) {
    for (const double angle_rad : p.hole_angles_rad) {
      const SinCos a = sin_cos(angle_rad);
      const Vector3 outward(a.cos, a.sin, 0.0);
      all.push_back({{Feature::Hole, i, Side::Left, k++},
                     middle + (p.hole_radius_m - tip_radius_m) * outward + Vector3(0, 0, level_m),
                     outward});
    }
  }
}

void append_rod(std::vector<NominalTouch>& all, const TouchPattern& p, std::size_t j,
                double tip_radius_m) {
  std::size_t k = 0;
  for (const double section_m : p.rod_sections_m) {
    for (const double angle_rad : p.rod_angles_rad) {
      const SinCos a = sin_cos(angle_rad);
      const Vector3 outward(a.cos, 0.0, a.sin);
      all.push_back(
          {{Feature::Rod, j, Side::Left, k++},
           Vector3(p.rod_x_m[j], section_m, 0.0) + (p.rod_radius_m + tip_radius_m) * outward,
           outward});
    }
  }
}

void append_plane(std::vector<NominalTouch>& all, const TouchPattern& p, std::size_t j, Side side,
                  double tip_radius_m) {
  const Vector3 outward = side == Side::Left ? Vector3::UnitY() : Vector3(-Vector3::UnitY());
  std::size_t k = 0;
  for (const double dx_m : p.plane_dx_m) {
    for (const double dz_m : p.plane_dz_m) {
      all.push_back(
          {{Feature::Plane, j, side, k++},
           Vector3(p.rod_x_m[j] + dx_m, 0.0, dz_m) + (p.plane_y_m + tip_radius_m) * outward,
           outward});
    }
  }
}

/// The deflection w EI / q (bar.hpp) without the terms c1 x + c2.
double free_deflection(const Sag& s, double x_m) {
  const auto power_of_positive = [](double v, int n) { return power(std::max(v, 0.0), n); };
  const double x0 = s.beam_x_m[0], x1 = s.beam_x_m[1], a = s.supports_m[0], b = s.supports_m[1];
  const double length = x1 - x0;
  const double at_b = length * (0.5 * (x0 + x1) - a) / (b - a), at_a = length - at_b;
  return power(x_m - x0, 4) / 24.0 - at_a * power_of_positive(x_m - a, 3) / 6.0 -
         at_b * power_of_positive(x_m - b, 3) / 6.0;
}

}  // namespace

std::string feature_name(const Target& t) {
  switch (t.feature) {
    case Feature::Hole:
      return hole_name(t.index);
    case Feature::Rod:
      return rod_name(t.index);
    case Feature::Plane:
      break;
  }
  return plane_name(t.index, t.side);
}

std::string name(const Target& t) {
  return message(feature_name(t), ", k = ", t.k);
}

std::size_t TouchPattern::touches_of(Feature feature) const {
  switch (feature) {
    case Feature::Hole:
      return hole_levels_m.size() * hole_angles_rad.size();
    case Feature::Rod:
      return rod_sections_m.size() * rod_angles_rad.size();
    case Feature::Plane:
      break;
  }
  return plane_dx_m.size() * plane_dz_m.size();
}

std::size_t TouchPattern::count() const {
  return holes() * touches_of(Feature::Hole) +
         rod_x_m.size() * (touches_of(Feature::Rod) + kPlanesOfRod * touches_of(Feature::Plane));
}

std::optional<std::size_t> TouchPattern::place_of(const Target& t) const {
  const std::size_t per_feature = touches_of(t.feature);
  const bool hole = t.feature == Feature::Hole, plane = t.feature == Feature::Plane;
  if (t.k >= per_feature || t.index >= (hole ? holes() : rod_x_m.size()) ||
      (!plane && t.side != Side::Left)) {
    return std::nullopt;
  }

  if (hole) {
    return t.index * per_feature + t.k;
  }
  const std::size_t first_rod = holes() * touches_of(Feature::Hole);
  if (!plane) {
    return first_rod + t.index * per_feature + t.k;
  }
  const std::size_t first_plane = first_rod + rod_x_m.size() * touches_of(Feature::Rod);
  return first_plane + (t.index * kPlanesOfRod + static_cast<std::size_t>(t.side)) * per_feature +
         t.k;
}

bool TouchPattern::has_signature() const {
  return std::any_of(hole_y_m.begin(), hole_y_m.end(), [](double y_m) { return y_m != 0.0; });
}

std::vector<NominalTouch> nominal_touches(const TouchPattern& pattern, double tip_radius_m) {
  std::vector<NominalTouch> all;
  all.reserve(pattern.count());
  for (std::size_t i = 0; i < pattern.holes(); ++i) {
    append_hole(all, pattern, i, tip_radius_m);
  }
  for (std::size_t j = 0; j < pattern.rod_x_m.size(); ++j) {
    append_rod(all, pattern, j, tip_radius_m);
  }
  for (std::size_t j = 0; j < pattern.rod_x_m.size(); ++j) {
    append_plane(all, pattern, j, Side::Left, tip_radius_m);
    append_plane(all, pattern, j, Side::Right, tip_radius_m);
  }
  return all;
}

std::vector<std::size_t> probing_order(const std::vector<NominalTouch>& touches) {
  std::vector<std::size_t> order(touches.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const Target &first = touches[a].target, &second = touches[b].target;
    return std::pair(first.index, first.feature != Feature::Hole) <
           std::pair(second.index, second.feature != Feature::Hole);
  });
  return order;
}

Vector3 sag_m(const Sag& s, double x_m, const Vector3& gravity) {
  constexpr double kGravity_m_per_s2 = 9.81;
  const double a = s.supports_m[0], b = s.supports_m[1];
  const double w_a = free_deflection(s, a), w_b = free_deflection(s, b);
  const double w = free_deflection(s, x_m) - w_a - (w_b - w_a) * (x_m - a) / (b - a);

  const double load = 12.0 * s.density_kg_per_m3 * kGravity_m_per_s2 / s.youngs_modulus_Pa;
  const auto deflection_m = [&](std::size_t direction) {
    return load * w / power(s.section_yz_m[direction], 2);
  };
  return {0.0, deflection_m(0) * gravity.y(), deflection_m(1) * gravity.z()};
}

std::vector<Vector3> O_at(const Bar& bar, double temperature_K) {
  const double alpha_per_K = bar.expansion ? bar.expansion->alpha_per_K : 0.0;
  const double factor = 1.0 + alpha_per_K * (temperature_K - kReferenceTemperature_K);
  std::vector<Vector3> at;
  for (const Vector3& O : bar.O_m) {
    at.emplace_back(factor * O);
  }
  return at;
}

}  // namespace abbe::calib::mfb
