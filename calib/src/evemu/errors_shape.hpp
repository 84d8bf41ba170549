#pragma once

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

/// BadInput where readings and errors make another artefact at every position, and one artefact
/// once the errors are reversed, taken in mm, or have an axis reversed or two swapped. Noise of
/// reading and V together leaves a scatter, too: only a change that leaves a third of it names a
/// mistake.
[[nodiscard]] Result<void> check_one_shape(const Observations&);

}  // namespace abbe::calib::evemu
