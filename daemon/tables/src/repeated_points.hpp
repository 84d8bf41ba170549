#pragma once
/// Removes points of a verification that are in a file twice.

#include "abbe/tables/input_files.hpp"

namespace abbe::daemon {

/// Removes points that repeat an earlier point in every digit, and counts them. If they stayed,
/// they would count as repeated measurements of one place and give a repeatability that was not
/// measured.
void leave_out_repeated(VerificationFile& file);

}  // namespace abbe::daemon
