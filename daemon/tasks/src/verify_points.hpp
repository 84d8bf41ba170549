#pragma once
/// Reads and stores the points of a verification, and converts them to the frame of the machine.

#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// The points for the models of `v`. They must belong to the same machine as the models, if their
/// machine is known: a file of points does not state it. Sets the members of `v` about points and
/// machines.
[[nodiscard]] Result<LivePoints> points_for(Verification& v, const VerifyArguments& arguments,
                                            const Progress& progress);
/// The points in the frame that the arguments name. An error names single points that do not fit,
/// or usual mistakes. `errors_at`: V of the first model.
[[nodiscard]] Result<calib::verify::Observations> observed_in(
    const VerifyArguments& arguments, const VerificationFile& file,
    const calib::verify::ErrorsAt& errors_at);
/// One line for each single point that does not fit the others; each line ends with `advice`.
[[nodiscard]] std::vector<std::string> lines_of_points_off(const VerificationFile& file,
                                                           const calib::fit::PointsOff& off,
                                                           std::string_view advice);

}  // namespace abbe::daemon
