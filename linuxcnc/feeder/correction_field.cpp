// SPDX-License-Identifier: GPL-2.0-or-later
#include "correction_field.hpp"

namespace abbe::linuxcnc {

std::optional<calib::Vector3> command_correction(const calib::ErrorLattice& field,
                                                 const calib::Vector3& position_m) {
  // Each pass multiplies the remaining error by the slope of V, 1e-3 at most: three give 1e-9 of c.
  constexpr int kPasses = 3;
  if (!position_m.allFinite()) return std::nullopt;

  calib::Vector3 correction_m = calib::Vector3::Zero();
  for (int pass = 0; pass < kPasses; ++pass) {
    calib::Vector3 V_m;
    if (!field.at(position_m + correction_m, V_m)) return std::nullopt;
    correction_m = -V_m;
  }
  return correction_m;
}

Wanted wanted(const Usable& usable, double silence_s, bool homed, const calib::Vector3& position_m,
              const FeedLimits& limits) {
  const auto refuse = [](std::string reason) {
    return Wanted{calib::Vector3::Zero(), false, std::move(reason)};
  };
  if (!homed) return refuse("not all joints are homed");
  if (silence_s > limits.longest_silence_s) return refuse("the DDS subscription does not answer");
  if (!usable.field) return refuse(usable.reason);

  const auto correction_m = command_correction(*usable.field, position_m);
  if (!correction_m) return refuse("outside the volume of the model");
  // A clamp that is NaN refuses, too.
  if (!(correction_m->cwiseAbs().maxCoeff() <= limits.clamp_m))
    return refuse("the correction is larger than the clamp");
  return {*correction_m, true, {}};
}

}  // namespace abbe::linuxcnc
