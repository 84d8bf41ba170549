#pragma once
/// Output of backlash (calib/otf/backlash.hpp): one object per difference for --json, one line per
/// table for people. Units: um for translations, urad for rotations.

#include <nlohmann/json.hpp>
#include <span>

#include "abbe/calib/otf/backlash.hpp"

namespace abbe::daemon {

[[nodiscard]] nlohmann::json backlash_json(std::span<const calib::otf::Backlash>);
/// The largest difference of each table.
void print_backlash(std::span<const calib::otf::Backlash>);

}  // namespace abbe::daemon
