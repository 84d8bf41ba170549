#pragma once
/// Reads the file of the option --points of `abbe verify`: verification.csv, or points that another
/// program exported together with the readings at which they were measured.

#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// Reads the file. BadInput names missing options for exported points, or options that
/// verification.csv does not need.
[[nodiscard]] Result<VerificationFile> read_verification(const VerifyArguments& arguments);

}  // namespace abbe::daemon
