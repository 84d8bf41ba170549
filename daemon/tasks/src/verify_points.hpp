#pragma once
/// The points of a verification: checked, read, kept, and in the frame of the machine.

#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// Usage unless there is a model and one kind of points, and for points of the running machine also
/// a folder to keep them.
[[nodiscard]] Result<void> check_verify(const VerifyArguments& arguments);

/// The points for models of `machines`. They must be of the same machine, as far as it is known: a
/// file of points does not state it. `different`: different_machines().
[[nodiscard]] Result<LivePoints> points_of(const VerifyArguments& arguments,
                                           std::vector<OfMachine> machines, std::string& different,
                                           const Progress& progress);
/// The points in the frame that the arguments name; an error names points that alone do not fit.
[[nodiscard]] Result<calib::verify::Observations> observed_in(const VerifyArguments& arguments,
                                                              const VerificationFile& file);
/// One line for each point that alone does not fit the others; `advice` ends each of them.
[[nodiscard]] std::vector<std::string> lines_of_points_off(const VerificationFile& file,
                                                           const calib::fit::PointsOff& off,
                                                           std::string_view advice);

}  // namespace abbe::daemon
