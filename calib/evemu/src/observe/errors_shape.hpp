#pragma once

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

/// Checks that ball centres (reading + V) have the same shape at all positions. BadInput if they do
/// not, but do after a change of the errors: reversed, converted from mm, one axis reversed or two
/// axes swapped. Noise of readings and V also makes the shapes scatter: a mistake is reported only
/// if its correction reduces the scatter to a third or less.
[[nodiscard]] Result<void> check_one_shape(const Observations&);

}  // namespace abbe::calib::evemu
