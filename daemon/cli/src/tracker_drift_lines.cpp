#include "tracker_drift_lines.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

nlohmann::json array_um(const calib::Vector3& v_m) {
  return {v_m.x() * kUmPerM, v_m.y() * kUmPerM, v_m.z() * kUmPerM};
}

}  // namespace

std::string tracker_drift_text(const TrackerDriftFigures& drift) {
  const calib::Vector3 value_um = kUmPerM * drift.largest_m;
  return fmt::format(
      "drift       of the tracker: largest {:.1f}, {:.1f}, {:.1f} um in X, Y, Z; {} visits of "
      "nests\n",
      value_um.x(), value_um.y(), value_um.z(), drift.visits);
}

nlohmann::json tracker_drift_json(const TrackerDriftFigures& drift) {
  return {{"largest_um", array_um(drift.largest_m)},
          {"nest_repeatability_um", drift.u_repeatability_m * kUmPerM},
          {"visits", drift.visits}};
}

}  // namespace abbe::daemon
