#pragma once
/// Statistics of vectors in the format of --json.

#include <nlohmann/json.hpp>

#include "abbe/base/units.hpp"
#include "abbe/calib/model_comparison.hpp"

namespace abbe::daemon {

[[nodiscard]] inline nlohmann::json vector_figures(const calib::VectorStatistics& s) {
  return {{"mean_um", s.mean_m * kUmPerM},
          {"rms_um", s.rms_m * kUmPerM},
          {"max_um", s.max_m * kUmPerM}};
}

}  // namespace abbe::daemon
