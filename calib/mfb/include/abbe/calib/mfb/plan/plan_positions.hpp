#pragma once
/// Positions of a Multi-Feature Bar in the travel of a machine, and the sets of measurements of
/// [Viprey 2016], adapted to travel, styli and bar. Whether a set shows the 21 errors is the matter
/// of plan_prediction.hpp. Collisions are not considered. Units: m, rad. Pure.
///
/// Roles: a, b, c are the axes from workpiece to tool. Angular errors of a and b are shown by two
/// positions that are apart across the bar, those of c by different tools only.

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
/// The stem of a stylus of a star: across the ram (last axis of the chain) if the tip is at least
/// 20 mm beside it, else along the ram.
[[nodiscard]] Stylus stylus_of(const Vector3& tool_offset_m, const KinematicChain&);

/// For what is planned. A stylus enters the holes along its stem from the probing side of the bar,
/// or, where a second stylus of opposite stem is used at the same position, from the other side.
struct PlanTask {
  Bar bar;
  MfbMachine machine;
  std::vector<Stylus> styli;
  Plan settings;                        ///< tip, noise and gravity; without measurements
  bool backward = true;                 ///< each pass has a backward pass as its pair
  std::optional<double> temperature_K;  ///< of all measurements
  /// Neighbouring bars along an axis that is longer than the bar have at least this share of their
  /// length in common: the poses of both are estimated from it.
  double overlap = 0.5;
};
/// The errors of check(Bar); BadInput for no stylus, a repeated one, a stem without length, a noise
/// or radius of the tip that is not possible, or an overlap outside 0.1 to 0.9.
[[nodiscard]] Result<void> check(const PlanTask&);

/// One clamping of the bar and the styli that probe it.
struct PlannedPosition {
  std::string name;  ///< of its measurements: "X1"
  BarPose pose;
  std::vector<std::size_t> styli;  ///< in PlanTask::styli
};

/// Readings of X, Y, Z at all touches of all measurements.
struct ReadingRange {
  Vector3 min_m = Vector3::Zero(), max_m = Vector3::Zero();
};
[[nodiscard]] ReadingRange readings_of(const Bar&, const Plan&);

enum class NamedSet {
  Paper,    ///< 17 measurements in 14 positions
  Rolled,   ///< the same with X3 rolled by 90 degrees: smaller u of EZX and EB0Z
  Minimum,  ///< 12 measurements
  Indexed,  ///< Rolled, placed about the centre of two rotary axes: 6 clampings
};
inline constexpr std::array kNamedSets{NamedSet::Paper, NamedSet::Rolled, NamedSet::Minimum,
                                       NamedSet::Indexed};
/// "paper", "rolled", "minimum", "indexed".
[[nodiscard]] std::string_view name(NamedSet);
[[nodiscard]] std::optional<NamedSet> set_named(std::string_view);

struct PlannedSet {
  std::vector<PlannedPosition> positions;
  std::vector<std::string> notes;  ///< bars that are inclined or overlap
  /// Measurements that are missing, and the stylus they need.
  std::vector<std::string> missing;

  /// Passes in one direction.
  [[nodiscard]] std::size_t measurements() const;
};

/// The middle of the places that the tip of a stylus along the ram reaches.
[[nodiscard]] Vector3 middle_of_travel(const PlanTask&);

/// A set, scaled to the travel. An axis longer than the bar gets several bars that overlap; along a
/// shorter one the bar is inclined. `centre_m`: where two rotary axes cross, for NamedSet::Indexed;
/// default: middle_of_travel(). The errors of check(); NotApplicable if a bar does not fit: the
/// text states the travel that is needed.
[[nodiscard]] Result<PlannedSet> named_set(NamedSet, const PlanTask&,
                                           const std::optional<Vector3>& centre_m = {});

/// More positions than any set has: bars along each axis at 3 x 3 places across it, each roll that
/// the styli allow, one stylus or two of opposite stem, and both diagonals of each plane.
[[nodiscard]] Result<std::vector<PlannedPosition>> candidate_positions(const PlanTask&);

/// The measurements of all positions in this order: each stylus forward and, with
/// PlanTask::backward, backward. Positions get the labels P1, P2, ...; O_1 is rounded to 0.1 mm.
[[nodiscard]] Plan plan_of(const PlanTask&, const std::vector<PlannedPosition>&);

}  // namespace abbe::calib::mfb
