#include "plan/plan_lattice.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/model/model_comparison.hpp"

namespace abbe::calib::otf {

std::vector<Vector3> plan_lattice(const MachineNodes& travel, std::size_t per_axis) {
  constexpr double kPerM = 1e4;
  MachineNodes few;
  for (const Axis a : kAllAxes) {
    const double first_m = travel[index(a)].nodes_m.front(),
                 last_m = travel[index(a)].nodes_m.back();
    few[index(a)].nodes_m.push_back(first_m);
    for (std::size_t i = 1; i + 1 < per_axis; ++i) {
      const double share = static_cast<double>(i) / static_cast<double>(per_axis - 1);
      few[index(a)].nodes_m.push_back(std::round(kPerM * (first_m + share * (last_m - first_m))) /
                                      kPerM);
    }
    few[index(a)].nodes_m.push_back(last_m);
  }
  return tensor_grid(few);
}

namespace {

/// Time that a stop adds to a path.
double stop_duration_s(const Drive& drive) {
  return drive.feed_m_per_s / drive.acceleration_m_per_s2 + drive.dwell_s;
}

}  // namespace

double longest_path_m(const PathBudget& budget, const Drive& drive, std::size_t legs) {
  const double moving_s = budget.duration_s - static_cast<double>(legs) * stop_duration_s(drive);
  return std::min(budget.length_m, drive.feed_m_per_s * moving_s);
}

double walk_length_m(const PathBudget& budget, const Drive& drive, double mean_leg_m) {
  const double per_m_s = 1.0 / drive.feed_m_per_s + stop_duration_s(drive) / mean_leg_m;
  return std::min(budget.length_m, budget.duration_s / per_m_s);
}

}  // namespace abbe::calib::otf
