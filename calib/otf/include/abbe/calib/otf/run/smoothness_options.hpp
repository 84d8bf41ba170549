#pragma once
/// Size of the prior for the smoothness of the error tables (smoothness.hpp).

#include <array>

namespace abbe::calib::otf {

struct SmoothnessOptions {
  /// For the tables of X, Y, Z: standard deviation of the bend of a table over three nodes 50 mm
  /// apart, see smoothness.hpp. 0: no prior for the tables of this axis.
  std::array<double, 3> bend_m{};
};
/// True if this is a permitted size of the prior: 0.01 um to 1 mm.
[[nodiscard]] inline bool is_bend_size(double bend_m) {
  constexpr double kLeast_m = 0.01e-6 * (1.0 - 1e-9), kMost_m = 1e-3 * (1.0 + 1e-9);
  return bend_m >= kLeast_m && bend_m <= kMost_m;
}

}  // namespace abbe::calib::otf
