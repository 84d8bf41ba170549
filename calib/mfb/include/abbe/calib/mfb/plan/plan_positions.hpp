#pragma once
/// Positions of a Multi-Feature Bar in the travel of a machine, and the sets of measurements of
/// [Viprey 2016], adapted to travel, styli and bar. plan_prediction.hpp computes whether a set
/// determines the 21 errors. Collisions are not considered. Units: m, rad. Pure.
///
/// Roles: a, b, c are the axes from workpiece to tool. Angular errors of a and b are determined by
/// two positions with a distance across the bar; angular errors of c only by different tools.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

struct Stylus {
  Vector3 tool_offset_m = Vector3::Zero();  ///< t: tool reference point to the centre of the tip
  Vector3 stem = -Vector3::UnitZ();         ///< unit vector from the shank to the tip
};
/// Makes a stylus of a star. Its stem is across the ram (last axis of the chain) if the tip is at
/// least 20 mm beside the ram, else along the ram.
[[nodiscard]] Stylus stylus_of(const Vector3& tool_offset_m, const KinematicChain&);

/// Input of planning. A stylus enters the holes along its stem from the probing side of the bar. If
/// a second stylus with the opposite stem is used at the same position, it enters from the other
/// side.
struct PlanTask {
  Bar bar;
  MfbMachine machine;
  std::vector<Stylus> styli;
  Plan settings;                        ///< tip, noise and gravity; without measurements
  bool backward = true;                 ///< each pass has a backward pass as its pair
  std::optional<double> temperature_K;  ///< temperature of all measurements
  /// If an axis is longer than the bar, neighbouring bars along it have at least this share of
  /// their length in common, from which the poses of both are estimated.
  double overlap = 0.5;
};
/// Checks the task. The errors of check(Bar); BadInput for no stylus, a repeated one, a stem
/// without length, a noise or radius of the tip that is not possible, or an overlap outside 0.1 to
/// 0.9.
[[nodiscard]] Result<void> check(const PlanTask&);

/// One clamping of the bar and the styli that probe it.
struct PlannedPosition {
  std::string name;  ///< prefix of the names of its measurements, such as "X1"
  BarPose pose;
  std::vector<std::size_t> styli;  ///< indices in PlanTask::styli
};

/// Readings of X, Y, Z at all touches of all measurements.
struct ReadingRange {
  Vector3 min_m = Vector3::Zero(), max_m = Vector3::Zero();
};
[[nodiscard]] ReadingRange readings_of(const Bar&, const Plan&);

enum class NamedSet {
  Paper,    ///< 17 measurements in 14 positions
  Rolled,   ///< as Paper, but X3 rolled by 90 degrees: smaller u of EZX and EB0Z
  Minimum,  ///< 12 measurements
  Indexed,  ///< as Rolled, placed about the centre of two rotary axes: 6 clampings
};
inline constexpr std::array kNamedSets{NamedSet::Paper, NamedSet::Rolled, NamedSet::Minimum,
                                       NamedSet::Indexed};
/// Returns "paper", "rolled", "minimum" or "indexed".
[[nodiscard]] std::string_view name(NamedSet);
[[nodiscard]] std::optional<NamedSet> set_named(std::string_view);

struct PlannedSet {
  std::vector<PlannedPosition> positions;
  std::vector<std::string> notes;  ///< bars that are inclined or overlap
  /// Measurements that are not possible, with the stylus they need.
  std::vector<std::string> missing;

  /// Number of passes, counted in one direction only.
  [[nodiscard]] std::size_t measurements() const;
};

/// Middle of the places that the tip of a stylus along the ram can reach.
[[nodiscard]] Vector3 middle_of_travel(const PlanTask&);

/// Places a set, scaled to the travel. An axis longer than the bar gets several bars that overlap;
/// along a shorter axis the bar is inclined. `centre_m`: place where two rotary axes cross, for
/// NamedSet::Indexed; default: middle_of_travel(). The errors of check(); NotApplicable if a bar
/// does not fit: the text states the travel that is needed.
[[nodiscard]] Result<PlannedSet> named_set(NamedSet, const PlanTask&,
                                           const std::optional<Vector3>& centre_m = {});

/// Returns more positions than any set has: bars along each axis at 3 x 3 places across it, each
/// roll that the styli allow, one stylus or two with opposite stems, and both diagonals of each
/// plane.
[[nodiscard]] Result<std::vector<PlannedPosition>> candidate_positions(const PlanTask&);

/// Makes the measurements of all positions in this order: each stylus forward and, with
/// PlanTask::backward, backward. Positions get the labels P1, P2, ...; O_1 is rounded to 0.1 mm.
[[nodiscard]] Plan plan_of(const PlanTask&, const std::vector<PlannedPosition>&);

}  // namespace abbe::calib::mfb
