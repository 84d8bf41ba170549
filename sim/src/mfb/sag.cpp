#include <algorithm>

#include "abbe/sim/mfb/true_bar.hpp"

namespace abbe::sim::mfb {

Sag reference_sag(const Pattern& pattern) {
  constexpr double kOverhang_m = 0.015, kLeastSag = 0.5537;  // distance of supports / length
  const double first_m = -kOverhang_m, last_m = pattern.length_m() + kOverhang_m;
  const double middle_m = 0.5 * (first_m + last_m);
  const double half_m = 0.5 * kLeastSag * (last_m - first_m);
  return {.beam_x_m = {first_m, last_m},
          .supports_m = {middle_m - half_m, middle_m + half_m},
          .section_yz_m = {0.036, 0.036}};
}

double sag_m(const Sag& sag, double height_m, double x_m) {
  constexpr double kGravity = 9.81;
  const double x0 = sag.beam_x_m[0], length = sag.beam_x_m[1] - x0;
  const double a = sag.supports_m[0], b = sag.supports_m[1];
  const double reaction_b = length * (x0 + 0.5 * length - a) / (b - a);
  const double reaction_a = length - reaction_b;

  // EI w / q without the line through the supports
  const auto bent = [&](double x) {
    const auto cube_beyond = [x](double at) {
      const double v = std::max(x - at, 0.0);
      return v * v * v;
    };
    const double u = x - x0;
    return u * u * u * u / 24.0 - reaction_a * cube_beyond(a) / 6.0 -
           reaction_b * cube_beyond(b) / 6.0;
  };
  const double along = (x_m - a) / (b - a);
  const double line = (1.0 - along) * bent(a) + along * bent(b);
  const double q_per_EI =
      12.0 * sag.density_kg_per_m3 * kGravity / (sag.youngs_modulus_Pa * height_m * height_m);
  return q_per_EI * (bent(x_m) - line);
}

}  // namespace abbe::sim::mfb
