#include "abbe/calib/mfb/run/touches_off.hpp"

#include "abbe/calib/fit/points_off.hpp"

namespace abbe::calib::mfb {
namespace {

/// The touches of a pass that belong to the pattern, with their planned places in the bar frame.
struct PlannedTouches {
  std::vector<std::size_t> touches;
  std::vector<Vector3> measured_m, planned_m;
};

PlannedTouches planned_touches(const PassTouches& pass, const TouchPattern& pattern,
                               const std::vector<NominalTouch>& nominal, const Measurement& m) {
  PlannedTouches out;
  for (std::size_t i = 0; i < pass.size(); ++i) {
    if (const auto place = pattern.place_of(pass[i].target)) {
      out.touches.push_back(i);
      out.measured_m.emplace_back(pass[i].reading_m + m.tool_offset_m);
      out.planned_m.push_back(nominal[*place].tip_m);
    }
  }
  return out;
}

}  // namespace

std::vector<TouchOff> touches_off(const Bar& bar, const Plan& plan,
                                  std::span<const PassTouches> passes) {
  const std::vector<NominalTouch> nominal = nominal_touches(bar.pattern, plan.tip_radius_m);
  std::vector<TouchOff> found;
  for (std::size_t pass = 0; pass < passes.size(); ++pass) {
    const auto planned =
        planned_touches(passes[pass], bar.pattern, nominal, plan.measurements[pass]);
    const auto off = fit::points_off(planned.measured_m, planned.planned_m);
    for (const auto& [point, distance_m] : off.points) {
      found.push_back({pass, planned.touches[point], distance_m, off.rms_others_m});
    }
  }
  return found;
}

}  // namespace abbe::calib::mfb
