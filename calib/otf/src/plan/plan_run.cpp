#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::calib::otf {
namespace {

/// Least distance at which the tracker can measure the reflector.
constexpr double kNearest_m = 0.05;
/// Least length of a leg that has segments in spite of Options::corner_m at both ends.
constexpr double kLeastTravel_m = 0.05;

struct PositiveQuantity {
  const char* name;
  double value;
  const char* unit;
};

Result<void> check_positive(const PlannedRun& run) {
  const PositiveQuantity quantities[] = {
      {"feed", kMmPerM * 60.0 * run.drive.feed_m_per_s, "mm/min"},
      {"acceleration", run.drive.acceleration_m_per_s2, "m/s^2"},
      {"points of the tracker", run.points_per_s, "per second"},
      {"sigma_range", kUmPerM * run.noise.sigma_range_m, "um"},
      {"sigma_angle", 1e6 * run.noise.sigma_angle_rad, "urad"}};
  for (const PositiveQuantity& q : quantities) {
    if (!(q.value > 0.0) || !std::isfinite(q.value)) {
      return failure(ErrorCode::BadInput,
                     message("plan: ", q.name, " ", q.value, " ", q.unit, ": must be positive"));
    }
  }
  if (!(run.drive.dwell_s >= 0.0) || !std::isfinite(run.drive.dwell_s)) {
    return failure(ErrorCode::BadInput,
                   message("plan: dwell ", run.drive.dwell_s, " s: must not be negative"));
  }
  return {};
}

Result<void> check_travel_of_axes(const MachineNodes& nodes) {
  for (const Axis a : kAllAxes) {
    const std::vector<double>& nodes_m = nodes[index(a)].nodes_m;
    if (Result<void> valid = check_nodes(nodes_m); !valid) {
      return failure(valid.error().code,
                     message("plan: axis ", letter(a), ": ", valid.error().text));
    }
    if (const double travel_m = nodes_m.back() - nodes_m.front(); travel_m < kLeastTravel_m) {
      return failure(
          ErrorCode::BadInput,
          message("plan: axis ", letter(a), " travels ", kMmPerM * travel_m, " mm, needs ",
                  kMmPerM * kLeastTravel_m, ": near the ends of a leg, points are not used"));
    }
  }
  return {};
}

/// Distance of the tracker from the box in which the reflector moves.
double distance_to_volume_m(const PlannedRun& run) {
  Vector3 outside_m = Vector3::Zero();
  for (Eigen::Index k = 0; k < 3; ++k) {
    const std::vector<double>& nodes_m = run.machine.nodes[static_cast<std::size_t>(k)].nodes_m;
    const double q = run.tracker_m[k] - run.machine.target_offset_m[k];
    outside_m[k] = std::max({nodes_m.front() - q, q - nodes_m.back(), 0.0});
  }
  return outside_m.norm();
}

}  // namespace

Result<void> check(const PlannedRun& run) {
  if (!run.tracker_m.allFinite() || !run.machine.target_offset_m.allFinite()) {
    return failure(ErrorCode::NotFinite, "plan: position of the tracker or of the target");
  }
  if (Result<void> valid = check_positive(run); !valid) {
    return valid;
  }
  if (Result<void> valid = check_travel_of_axes(run.machine.nodes); !valid) {
    return valid;
  }

  const double distance_m = distance_to_volume_m(run);
  if (distance_m < kNearest_m) {
    return failure(
        ErrorCode::BadInput,
        message("plan: the tracker at ", mm_text(run.tracker_m), " is ",
                distance_m > 0.0 ? message(kMmPerM * distance_m, " mm from") : "inside",
                " the volume in which the reflector moves, needs ", kMmPerM * kNearest_m, " mm"));
  }
  return {};
}

}  // namespace abbe::calib::otf
