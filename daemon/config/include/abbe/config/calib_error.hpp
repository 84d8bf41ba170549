#pragma once
/// Errors of the mathematics. Pure.

#include "abbe/base/error.hpp"
#include "abbe/calib/error.hpp"

namespace abbe::daemon {

/// An error of the mathematics in the daemon's words and exit codes.
[[nodiscard]] Error error_of(const calib::Error& error);

}  // namespace abbe::daemon
