#pragma once
/// Mistakes in a path file that explain why points do not fit it.

#include <functional>
#include <string>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Names the modified paths for which `fits` returns true: driven backwards, reflected, in another
/// unit of length. "; they fit with the path driven backwards". Empty if none does.
[[nodiscard]] std::string corrections_that_fit(const Path&, const MachineNodes& travel,
                                               const std::function<bool(const Path&)>& fits);

}  // namespace abbe::calib::otf
