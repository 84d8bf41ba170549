#pragma once
/// Reads the thermal expansion of an artefact from its file: alpha_um_per_m_K and
/// u_alpha_um_per_m_K, both or neither.

#include <optional>

#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {

/// Adds a fault if only one of the keys is given.
inline void read_expansivity(Section& head, std::optional<calib::Expansivity>& out) {
  calib::Expansivity given;
  const bool alpha = head.get("alpha_um_per_m_K", given.alpha_per_K, kMicro, {-50.0, 50.0});
  const bool u_alpha = head.get("u_alpha_um_per_m_K", given.u_alpha_per_K, kMicro, {0.0, 50.0});
  if (alpha && u_alpha) out = given;
  if (alpha && !head.has("u_alpha_um_per_m_K"))
    head.fault("alpha_um_per_m_K", "also needs u_alpha_um_per_m_K");
  if (u_alpha && !head.has("alpha_um_per_m_K"))
    head.fault("u_alpha_um_per_m_K", "also needs alpha_um_per_m_K");
}

}  // namespace abbe::daemon
