#include "abbe/calib/otf/orientation.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "message.hpp"

namespace abbe::calib::otf {
namespace {

constexpr double kTravelTolerance_m = 1e-3;

Vector3 half_turned(const Vector3& v, Axis about) {
  const Vector3 direction = Vector3::Unit(static_cast<Eigen::Index>(index(about)));
  return 2.0 * direction.dot(v) * direction - v;
}

bool within_travel(const Vector3& q, const MachineNodes& nodes) {
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    const double x = q(static_cast<Eigen::Index>(a));
    if (x < nodes[a].nodes_m.front() - kTravelTolerance_m) return false;
    if (x > nodes[a].nodes_m.back() + kTravelTolerance_m) return false;
  }
  return true;
}

/// Of a direction: its chord is the angle in rad for small angles. 10 degrees: axes of a machine are not that
/// far off the plumb line.
constexpr double kUpTolerance = 0.17;
/// Where the tracker stands, by a tape measure.
constexpr double kPlaceTolerance_m = 0.5;

std::string list_of(const std::vector<Axis>& axes) {
  std::string list;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    if (i > 0) list += i + 1 < axes.size() ? ", " : " or ";
    list += letter(axes[i]);
  }
  return list;
}

/// The half turn that brings `found` to `given`, as words.
std::string cure(const Vector3& found, const Vector3& given, double at_most) {
  for (const Axis about : kAllAxes)
    if ((half_turned(found, about) - given).norm() <= at_most)
      return message("; it does after a turn by 180 degrees about ", letter(about),
                     ": the signs of the other two axes are reversed in the path file");
  return "; check the evidence and the axes of the path file";
}

/// False and a reason where `found` contradicts `given`; else keeps of `open` what the evidence does not
/// exclude.
bool agrees(Verdict& verdict, std::vector<Axis>& open, const Vector3& found, const Vector3& given,
            double at_most, const std::string& what) {
  if (!((found - given).norm() <= at_most)) {
    verdict.refuse("orientation", message("path orientation: ", what, cure(found, given, at_most)));
    return false;
  }
  const auto excluded = [&](Axis about) {
    return (half_turned(found, about) - given).norm() > 2.0 * at_most;
  };
  open.erase(std::remove_if(open.begin(), open.end(), excluded), open.end());
  return true;
}

bool agrees_with_up(Verdict& verdict, std::vector<Axis>& open, const RigidTransform& T_machine_tracker,
                    const Vector3& up) {
  const Vector3 found = T_machine_tracker.R.col(2);
  const double off_rad = 2.0 * std::asin(std::min(1.0, 0.5 * (found - up).norm()));
  return agrees(verdict, open, found, up, kUpTolerance,
                message("the axis of the levelled tracker does not point along the machine's up but is ",
                        180.0 / std::numbers::pi * off_rad, " degrees off"));
}

/// The path turns about the machine's zero, what the tracker sees about the target offset.
bool agrees_with_place(Verdict& verdict, std::vector<Axis>& open, const Vector3& found_m,
                       const Vector3& given_m, const Vector3& target_offset_m) {
  return agrees(
      verdict, open, found_m - target_offset_m, given_m - target_offset_m, kPlaceTolerance_m,
      message("the tracker comes out ", (found_m - given_m).norm(), " m from the place that is given"));
}

}  // namespace

std::vector<Axis> possible_half_turns(const Path& path, const MachineNodes& nodes) {
  std::vector<Axis> possible;
  for (const Axis about : kAllAxes) {
    const bool stays = std::all_of(path.vertices_m.begin(), path.vertices_m.end(), [&](const Vector3& q) {
      return within_travel(half_turned(q, about), nodes);
    });
    if (stays) possible.push_back(about);
  }
  return possible;
}

void require_orientation(Verdict& verdict, const Path& path, const MachineNodes& nodes,
                         const Vector3& target_offset_m, const RigidTransform& T_machine_tracker,
                         const OrientationEvidence& evidence) {
  std::vector<Axis> open = possible_half_turns(path, nodes);
  if (evidence.scales_agree) open.clear();
  if (evidence.up && !agrees_with_up(verdict, open, T_machine_tracker, *evidence.up)) return;
  if (evidence.tracker_m &&
      !agrees_with_place(verdict, open, T_machine_tracker.t_m, *evidence.tracker_m, target_offset_m))
    return;
  if (open.empty()) return;
  const std::string text =
      message("path orientation: the path file would fit as well turned by 180 degrees about ", list_of(open),
              " (signs of the other two axes reversed), and nothing given excludes it");
  if (evidence.accepted) {
    verdict.notes.push_back(text);
  } else {
    verdict.refuse("orientation", message(text,
                                          "; give a recording with the scales, tracker.vertical or "
                                          "tracker.position_mm, or accept ",
                                          kPathOrientation));
  }
}

}  // namespace abbe::calib::otf
