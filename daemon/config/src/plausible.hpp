#pragma once
/// Checks that values are plausible for a real machine. A value beyond these limits is probably in
/// a wrong unit or mistyped, and is a fault in a configuration that a person wrote. A recorded
/// configuration is not checked (Section::implausible()).

#include <string_view>

#include "abbe/config/config.hpp"
#include "classified_section.hpp"

namespace abbe::daemon {

/// Shorter than any axis of a machine tool or measuring machine. A travel of 0.3 mm, for example,
/// is probably 300 mm that was entered in m.
inline constexpr double kShortestTravel_m = 1e-3;

/// Adds a fault at `key` (max_mm) if a linear axis with min < max is shorter than
/// kShortestTravel_m.
void check_travel_length(ClassifiedSection& axis, std::string_view key, const AxisConfig& config);

/// Reads the host name or network address of a device. Adds a fault if the text can be neither.
bool get_host(ClassifiedSection& section, Key key, std::string& out, Need need = Need::Optional);

}  // namespace abbe::daemon
