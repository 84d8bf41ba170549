#pragma once
/// The wish to end the improvement of a path, between two steps of it.

#include "abbe/calib/otf/plan/plan.hpp"

namespace abbe::calib::otf {

/// True: return the path found so far.
[[nodiscard]] inline bool is_enough(const PlanOptions& options) {
  return options.enough && options.enough();
}

}  // namespace abbe::calib::otf
