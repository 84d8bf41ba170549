#pragma once
/// Limits of what a real machine has. A value beyond them is a mistake in the unit or a typing
/// error, and is a fault of a configuration that a person wrote. A recorded configuration is not
/// judged by them (Section::implausible()).

#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/config/section.hpp"

namespace abbe::daemon {

/// Shorter than any axis of a machine tool or measuring machine. 0.3 mm is 300 mm given in m.
inline constexpr double kShortestTravel_m = 1e-3;

/// Adds a fault at `key` (max_mm) if a linear axis with min < max is shorter than
/// kShortestTravel_m.
void check_travel_length(Section& axis, std::string_view key, const AxisConfig& config);

/// Reads the name or address of a device in the network. Adds a fault if it can be neither.
bool get_host(Section& section, std::string_view key, std::string& out, Need need = Need::Optional);

}  // namespace abbe::daemon
