// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// The command correction of a received error model. Pure; a value may be read by several threads.

#include <optional>
#include <string>

#include "abbe/calib/error_lattice.hpp"

namespace abbe::linuxcnc {

/// The correction c = -V(p + c) that moves the tool to p when p + c is commanded (abbe_v1.idl),
/// from the grid of V. p: joint positions as LinuxCNC shows them, which must be abbe's axis
/// positions. Lengths in m.
/// nullopt if p + c is not in a cell of the grid of which every corner is inside the volume.
[[nodiscard]] std::optional<calib::Vector3> command_correction(const calib::ErrorLattice& field,
                                                               const calib::Vector3& position_m);

/// What the subscription passes to the loop that writes the pins.
struct Usable {
  std::optional<calib::ErrorLattice> field;  ///< nullopt: nothing may be applied, see reason
  std::string reason;
  std::string model_id;
};

/// Decision for one cycle.
struct Wanted {
  calib::Vector3 correction_m = calib::Vector3::Zero();
  bool valid = false;
  std::string reason;  ///< why not valid
};

struct FeedLimits {
  double clamp_m = 0.2e-3;  ///< that of the realtime component: a larger c is not applied in part
  double longest_silence_s = 0.25;  ///< of the subscription's thread
};

/// `silence_s`: since the subscription's thread last decided.
[[nodiscard]] Wanted wanted(const Usable& usable, double silence_s, bool homed,
                            const calib::Vector3& position_m, const FeedLimits& limits);

}  // namespace abbe::linuxcnc
