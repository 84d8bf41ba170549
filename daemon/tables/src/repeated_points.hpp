#pragma once
/// Points of a verification that stand in a file twice.

#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Leaves out points that repeat an earlier one in every digit, and counts them: as shots of one
/// place they would prove a repeatability that nobody measured.
void leave_out_repeated(VerificationFile& file);

}  // namespace abbe::daemon
