#include "abbe/calib/otf/travel.hpp"

#include <cmath>

namespace abbe::calib::otf {

std::vector<AxisTravel> travel_along(std::span<const Vector3> vertices_m, Mode mode) {
  constexpr double kRests_m = 1e-6;  // an axis that moves less keeps its direction
  std::vector<AxisTravel> all;
  AxisTravel now{};
  if (mode == Mode::Standstill) {
    all.push_back(now);
  }

  for (std::size_t leg = 0; leg + 1 < vertices_m.size(); ++leg) {
    const Vector3 way_m = vertices_m[leg + 1] - vertices_m[leg];
    for (Eigen::Index a = 0; a < 3; ++a) {
      if (std::abs(way_m(a)) > kRests_m) {
        now[static_cast<std::size_t>(a)] =
            way_m(a) > 0.0 ? estimation::Travel::Forward : estimation::Travel::Backward;
      }
    }
    all.push_back(now);
  }

  return all;
}

}  // namespace abbe::calib::otf
