#pragma once
/// Conversion of errors of the module calib. Pure.

#include "abbe/base/error.hpp"
#include "abbe/calib/base/error.hpp"

namespace abbe::daemon {

/// Converts an error of calib to an error of the daemon, with its exit code.
[[nodiscard]] Error error_of(const calib::Error& error);

}  // namespace abbe::daemon
