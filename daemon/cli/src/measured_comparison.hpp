#pragma once
/// `abbe model compare MODEL --measured FILE`: a model against directly measured error motions.

#include <CLI/App.hpp>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::daemon {

struct MeasuredOptions {
  std::string file;  ///< measured.csv; empty: not wanted
  std::string straightness = "end-points";
  double u_um = 0.0, u_urad = 0.0, u_ppm = 0.0;  ///< of the device, k = 1
};

/// Adds --measured and its options; returns --measured.
CLI::Option* add_measured_options(CLI::App& command, MeasuredOptions& options);

/// Prints the comparison as text or as one JSON object. The exit code: 5 if a table contradicts; 1
/// if no table could be tested, or if single values do not fit the others; else 0.
[[nodiscard]] Result<int> compare_with_measured(const calib::VolumetricModel& model,
                                                const MeasuredOptions& options, bool as_json);

}  // namespace abbe::daemon
