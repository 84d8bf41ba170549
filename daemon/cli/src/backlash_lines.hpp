#pragma once
/// Output of backlash (calib/model/backlash.hpp): one object per difference for --json, one line
/// per table for people. Units: um for translations, urad for rotations.

#include <nlohmann/json.hpp>
#include <span>

#include "abbe/calib/model/backlash.hpp"

namespace abbe::daemon {

[[nodiscard]] nlohmann::json backlash_json(std::span<const calib::Backlash>);
/// The largest difference of each table.
void print_backlash(std::span<const calib::Backlash>);

}  // namespace abbe::daemon
