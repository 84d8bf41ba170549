#pragma once
/// The passes along a Multi-Feature Bar that measure a machine with three linear axes: the place of
/// the bar, the tool, and the direction of probing. Machine axes, m. Pure.

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/mfb/pattern.hpp"

namespace abbe::sim::mfb {

/// Forward: from hole 1 to hole N; Backward: from hole N to hole 1
enum class Pass : std::uint8_t { Forward, Backward };

/// One pass along the bar.
struct Measurement {
  /// passes with the same `position` belong to one clamping of the bar
  std::string name, position;
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< planned position of the tip at O_1
  Eigen::Vector3d bar_x = Eigen::Vector3d::UnitX();    ///< bar axes in machine axes, unit vectors
  Eigen::Vector3d bar_z = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d tool_offset_m = Eigen::Vector3d::Zero();  ///< tool reference point to tip
  Pass pass = Pass::Forward;
  Probed probed = Probed::FromAbove;
};

enum class PlanKind : std::uint8_t {
  Full,        ///< 17 measurements in 14 positions
  Fewest,      ///< 12 measurements, the smallest number that determines all 21 errors
  FullRolled,  ///< 17 measurements, with the holes of X3 along Y
};
enum class Passes : std::uint8_t { ForwardAlone, Pairs };

/// The plan of [Viprey 2016], as reconstructed for a bar of 550 mm in a cube of 550 mm. Positions
/// are scaled with the length of the bar, tools are not. With pairs, every measurement is followed
/// by a backward measurement, named with " back".
[[nodiscard]] std::vector<Measurement> reference_plan(PlanKind kind, Passes passes,
                                                      double bar_length_m);

}  // namespace abbe::sim::mfb
