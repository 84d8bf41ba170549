#pragma once
/// The passes along a Multi-Feature Bar that measure a machine with three linear axes: where the
/// bar lies, with which tool and in which direction it is probed. Machine axes, m. Pure.

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/mfb/pattern.hpp"

namespace abbe::sim::mfb {

enum class Pass : std::uint8_t { Forward, Backward };  ///< from hole 1 to hole N, or from N to 1

/// One pass along the bar.
struct Measurement {
  std::string name, position;  ///< passes with one position: one clamping of the bar
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< place of the tip on O_1, as planned
  Eigen::Vector3d bar_x = Eigen::Vector3d::UnitX();    ///< bar axes in machine axes, unit vectors
  Eigen::Vector3d bar_z = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d tool_offset_m = Eigen::Vector3d::Zero();  ///< tool reference point to tip
  Pass pass = Pass::Forward;
  Probed probed = Probed::FromAbove;
};

enum class PlanKind : std::uint8_t {
  Full,        ///< 17 measurements in 14 positions
  Fewest,      ///< 12: the least with which all 21 errors show
  FullRolled,  ///< 17, with the holes of X3 along Y
};
enum class Passes : std::uint8_t { ForwardAlone, Pairs };

/// The plan of [Viprey 2016] as reconstructed for a bar of 550 mm in a cube of 550 mm; positions
/// are in proportion to the length of the bar, tools are not. With pairs every measurement is
/// followed by its way back, named with " back".
[[nodiscard]] std::vector<Measurement> reference_plan(PlanKind kind, Passes passes,
                                                      double bar_length_m);

}  // namespace abbe::sim::mfb
