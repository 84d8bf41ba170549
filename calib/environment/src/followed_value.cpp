#include "abbe/calib/environment/followed_value.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::calib {

double moved_towards(double from, double to, double most) noexcept {
  return std::clamp(to, from - most, from + most);
}

double followed_value(const FollowedValue& from, double target, std::chrono::nanoseconds at,
                      double most_per_s) noexcept {
  if (std::isnan(from.value) || std::isnan(target)) return target;
  const double elapsed_s = std::max(0.0, std::chrono::duration<double>(at - from.at).count());
  if (std::isinf(most_per_s)) return target;
  return moved_towards(from.value, target, most_per_s * elapsed_s);
}

}  // namespace abbe::calib
