#pragma once
/// --points of `abbe verify`: verification.csv, or points that another program exported, with the
/// readings at which they were measured.

#include "abbe/tasks/verify.hpp"

namespace abbe::daemon {

/// BadInput with what is missing for exported points, or for options that verification.csv does not
/// need.
[[nodiscard]] Result<VerificationFile> read_verification(const VerifyArguments& arguments);

}  // namespace abbe::daemon
