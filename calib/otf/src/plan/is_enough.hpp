#pragma once
/// Tells whether the caller wants to end the improvement of a path.

#include "abbe/calib/otf/plan/plan.hpp"

namespace abbe::calib::otf {

/// True if the caller wants to end the improvement of a path and get the path found so far.
[[nodiscard]] inline bool is_enough(const PlanOptions& options) {
  return options.enough && options.enough();
}

}  // namespace abbe::calib::otf
