#pragma once
/// Check for cancellation between two steps of a long computation.

#include <functional>

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

/// Returns NotConverged if `stopped` returns true. `stopped` may be empty.
[[nodiscard]] inline Result<void> check_stopped(const std::function<bool()>& stopped) {
  if (stopped && stopped()) {
    return failure(ErrorCode::NotConverged, "identification: stopped before its end");
  }
  return {};
}

}  // namespace abbe::calib
