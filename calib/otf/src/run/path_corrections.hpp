#pragma once
/// Mistakes in the file of a path or of a tracker that explain why points do not fit the path.

#include <functional>
#include <string>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// Names the modified paths for which `fits` returns true: driven backwards, reflected, in another
/// unit of length. Text such as "; they fit with the path driven backwards"; empty if none fits.
[[nodiscard]] std::string corrections_that_fit(const Path&, const MachineNodes& travel,
                                               const std::function<bool(const Path&)>& fits);

/// Names the other meanings of the angles for which `fits` returns true. Text such as "; they fit
/// with zenith angles instead of elevations"; empty if none fits.
[[nodiscard]] std::string angles_that_fit(const std::function<bool(const AngleMistake&)>& fits);

}  // namespace abbe::calib::otf
