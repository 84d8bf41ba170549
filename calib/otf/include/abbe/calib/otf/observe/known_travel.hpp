#pragma once
/// The legs of a run on which the direction of travel of every axis is known. Only these are used
/// if backlash is estimated (backlash.hpp). Pure.

#include <cstddef>
#include <span>
#include <string>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

[[nodiscard]] bool estimates_backlash(const Observations&);
/// The first leg (standstill: position) on which the direction of travel of all axes is known.
/// RankDeficient if an axis does not move on the path.
[[nodiscard]] Result<std::size_t> first_with_known_travel(std::span<const AxisTravel>);
/// With backlash the legs before it are not used. "the legs before 2 are not used: Z had not moved
/// yet, ..."; empty if all are used.
[[nodiscard]] std::string note_on_unused(const Observations&);
/// The first leg that is used; adds note_on_unused() to the notes. 0 without backlash. The error of
/// first_with_known_travel().
[[nodiscard]] Result<std::size_t> first_with_backlash(Observations&);

}  // namespace abbe::calib::otf
