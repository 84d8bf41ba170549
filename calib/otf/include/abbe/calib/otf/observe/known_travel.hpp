#pragma once
/// Finds the legs of a run on which the direction of travel of every axis is known. If backlash is
/// estimated, only these legs are used (backlash.hpp). Pure.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

[[nodiscard]] bool estimates_backlash(const Observations&);
/// The first leg (standstill: position) on which the direction of travel of all axes is known.
/// RankDeficient if an axis does not move on the path.
[[nodiscard]] Result<std::size_t> first_with_known_travel(std::span<const AxisTravel>);
/// Note on the legs that are not used because of backlash, such as "the legs before 2 are not used:
/// Z had not moved yet, ..."; empty if all legs are used.
[[nodiscard]] std::string note_on_unused(const Observations&);
/// Index of the first leg that is used (0 without backlash); adds note_on_unused() to the notes.
/// The error of first_with_known_travel().
[[nodiscard]] Result<std::size_t> first_with_backlash(Observations&);

}  // namespace abbe::calib::otf
