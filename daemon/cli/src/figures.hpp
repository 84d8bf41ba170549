#pragma once
/// Statistics in the format of --json.

#include <nlohmann/json.hpp>

#include "abbe/base/units.hpp"
#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/calib/verify/observe.hpp"

namespace abbe::daemon {

[[nodiscard]] inline nlohmann::json vector_figures(const calib::VectorStatistics& s) {
  return {{"mean_um", s.mean_m * kUmPerM},
          {"rms_um", s.rms_m * kUmPerM},
          {"max_um", s.max_m * kUmPerM}};
}

/// null: no place was measured twice.
[[nodiscard]] inline nlohmann::json repeatability_figure(const calib::verify::Observations& o) {
  return o.repeatability_m ? nlohmann::json(kUmPerM * *o.repeatability_m) : nlohmann::json();
}

}  // namespace abbe::daemon
