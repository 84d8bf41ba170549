// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// The command correction of a received error model. Pure, without allocation; a value may be read
/// by several threads.

#include <optional>
#include <string>

#include "abbe/messages/error_lattice.hpp"
#include "hand_over.h"

namespace abbe::linuxcnc {

/// The correction c = -V(p + c) that moves the tool to p when p + c is commanded (abbe_v1.idl),
/// from the grid of V. p: joint positions as LinuxCNC shows them; they must be equal to abbe's axis
/// positions. Lengths in m.
/// nullopt if p + c is not in a cell of the grid of which every corner is inside the volume.
[[nodiscard]] std::optional<Eigen::Vector3d> command_correction(const daemon::ErrorLattice& field,
                                                                const Eigen::Vector3d& position_m);

/// A model for one tool is applied to tools whose offset differs by at most this, as in abbe
/// (VolumetricModel::holds_for_tool).
inline constexpr double kToolTolerance_m = 0.5e-3;

/// The decision that the subscription passes to the loop of the feeder.
struct Usable {
  std::optional<daemon::ErrorLattice> field;  ///< nullopt: no correction may be applied; see reason
  std::string reason = {};
  std::string model_id = {};
  /// tool offset for which V of the field holds
  Eigen::Vector3d tool_offset_m = Eigen::Vector3d::Zero();
  /// False: the publisher is an abbe-dds of an earlier version and was selected by the name of the
  /// machine only.
  bool identified = true;
};

struct FeedOptions {
  double clamp_m = 0.2e-3;  ///< clamp of the realtime component; a larger c is refused as a whole
  /// longest time without a decision of the subscription's thread
  double longest_silence_s = 0.25;
  /// abbe's tool offset (tool reference point to functional point) while motion.tooloffset is 0.
  /// The offset of any tool is this vector minus motion.tooloffset: LinuxCNC subtracts its offset
  /// from the position of the tool reference point to show that of the functional point.
  Eigen::Vector3d tool_offset_at_zero_m = Eigen::Vector3d::Zero();
};

/// The decision for one cycle: the values for the realtime component, with a reason if they are not
/// valid. `silence_s`: time since the last decision of the subscription's thread.
[[nodiscard]] abbe_wanted wanted(const Usable& usable, double silence_s,
                                 const abbe_control& control, const FeedOptions& options);

}  // namespace abbe::linuxcnc
