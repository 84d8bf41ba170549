#pragma once
/// The points of a verification: read, kept, and in the frame of the machine.

#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// The points for the models of `v`. They must be of the same machine, as far as it is known: a
/// file of points does not state it. Sets in `v` what it states of points and machines.
[[nodiscard]] Result<LivePoints> points_for(Verification& v, const VerifyArguments& arguments,
                                            const Progress& progress);
/// The points in the frame that the arguments name; an error names points that alone do not fit, or
/// usual mistakes. `errors_at`: V of the first model.
[[nodiscard]] Result<calib::verify::Observations> observed_in(
    const VerifyArguments& arguments, const VerificationFile& file,
    const calib::verify::ErrorsAt& errors_at);
/// One line for each point that alone does not fit the others; `advice` ends each of them.
[[nodiscard]] std::vector<std::string> lines_of_points_off(const VerificationFile& file,
                                                           const calib::fit::PointsOff& off,
                                                           std::string_view advice);

}  // namespace abbe::daemon
