#pragma once

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

/// BadInput if readings and errors describe an artefact of another shape at every position, but one
/// shape once the errors are reversed, converted from mm, or have an axis reversed or two axes
/// swapped. Noise of readings and V also makes the shapes scatter: a mistake is reported only if
/// correcting it reduces the scatter to a third or less.
[[nodiscard]] Result<void> check_one_shape(const Observations&);

}  // namespace abbe::calib::evemu
