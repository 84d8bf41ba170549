#include "abbe/calib/otf/run/travel.hpp"

#include <cmath>

namespace abbe::calib::otf {

AxisTravel travel_after(AxisTravel before, const Vector3& motion_m) {
  constexpr double kRests_m = 1e-6;
  for (Eigen::Index a = 0; a < 3; ++a) {
    if (std::abs(motion_m(a)) > kRests_m) {
      before[static_cast<std::size_t>(a)] = motion_m(a) > 0.0 ? Travel::Forward : Travel::Backward;
    }
  }
  return before;
}

std::vector<AxisTravel> travel_along(std::span<const Vector3> vertices_m, Mode mode) {
  std::vector<AxisTravel> all;
  AxisTravel now{};
  if (mode == Mode::Standstill) {
    all.push_back(now);
  }

  for (std::size_t leg = 0; leg + 1 < vertices_m.size(); ++leg) {
    now = travel_after(now, vertices_m[leg + 1] - vertices_m[leg]);
    all.push_back(now);
  }

  return all;
}

}  // namespace abbe::calib::otf
