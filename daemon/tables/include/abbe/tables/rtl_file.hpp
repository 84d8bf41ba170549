#pragma once
/// .rtl: positioning errors of one axis that a Renishaw laser interferometer measured. Text with
/// the sections HEADER, TARGET DATA, RUNS and DEVIATIONS; all others (USER-TEXT, ENVIRONMENT,
/// EQUIPMENT) are not read. docs/files.md states from where the format is known. Faults as in
/// input_files.hpp.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/tables/measured_file.hpp"

namespace abbe::daemon {

/// What the file does not state.
struct RtlOptions {
  std::string error;  ///< "EXX", "EYY" or "EZZ"
  /// Positions of the axes during the measurement; that of the moving axis has no effect.
  calib::Vector3 line_m = calib::Vector3::Zero();
  double metres_per_deviation = 0.0;  ///< unit of the deviations; targets are in mm
};

/// True if the text begins with the section HEADER.
[[nodiscard]] bool is_rtl(std::string_view text);

/// The runs of the file as those of measured.csv: the n-th run towards larger positions and the
/// n-th towards smaller ones are run n. The direction of a run follows from the order of its rows.
/// A fault: a missing or repeated section, another file type than rtl, counts that do not fit, a
/// run that turns, repeats or lacks a target, a different number of runs in both directions.
[[nodiscard]] Result<MeasuredFile> parse_rtl(std::string_view text,
                                             const std::filesystem::path& file,
                                             const RtlOptions& options);

}  // namespace abbe::daemon
