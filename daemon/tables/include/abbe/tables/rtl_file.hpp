#pragma once
/// .rtl: positioning errors of one axis that a Renishaw laser interferometer measured. Text with
/// the sections HEADER, TARGET DATA, RUNS and DEVIATIONS; all others (USER-TEXT, ENVIRONMENT,
/// EQUIPMENT) are not read. docs/files.md names the source of the format. Faults as in
/// input_files.hpp.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/tables/measured_file.hpp"

namespace abbe::daemon {

/// Information that the file does not contain.
struct RtlOptions {
  std::string error;  ///< "EXX", "EYY" or "EZZ"
  /// Positions of the axes during the measurement; that of the moving axis has no effect.
  calib::Vector3 line_m = calib::Vector3::Zero();
  double metres_per_deviation = 0.0;  ///< unit of the deviations in m; targets are in mm
};

/// True if the text begins with the section HEADER.
[[nodiscard]] bool is_rtl(std::string_view text);

/// Converts the runs of the file to the form of measured.csv: the n-th run towards larger positions
/// and the n-th run towards smaller positions get the number n. The direction of a run follows from
/// the order of its rows. Faults are a missing or repeated section, a file type other than rtl,
/// counts that do not fit together, a run that reverses or that repeats or lacks a target, and
/// different numbers of runs in the two directions.
[[nodiscard]] Result<MeasuredFile> parse_rtl(std::string_view text,
                                             const std::filesystem::path& file,
                                             const RtlOptions& options);

}  // namespace abbe::daemon
