#pragma once
/// The files of the calibration of a Multi-Feature Bar that an identification with the bar does not
/// read: the step gauge, and the calibrated bar as text. Faults as in input_files.hpp. The
/// functions may be called from any thread.

#include <filesystem>
#include <string>
#include <string_view>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/mfb/identify/bar_calibration.hpp"

namespace abbe::daemon {

/// gauge.toml:
///
///   [gauge]  name, origin_mm, tool_offset_mm, u_um, u_um_per_m, temperature_C, u_temperature_K,
///            alpha_um_per_m_K and u_alpha_um_per_m_K (both or neither), u_rotation_urad,
///            u_alignment_mrad
///   [[step]] distance_mm, readings_mm ([x, y, z] of each run)
struct GaugeFile {
  InputFile source;
  calib::mfb::StepGauge gauge;
};
[[nodiscard]] Result<GaugeFile> read_gauge_toml(const std::filesystem::path& file);
/// Reads the same file for a gauge that may not be measured yet: either all [[step]] have
/// readings_mm, or none.
[[nodiscard]] Result<GaugeFile> read_gauge_to_measure(const std::filesystem::path& file);

/// The text of a gauge.toml with the readings of `gauge`. It begins with `comment`; each line of
/// `comment` must begin with #.
[[nodiscard]] std::string gauge_toml(const calib::mfb::StepGauge& gauge, std::string_view comment);

/// The text of a bar.toml with the covariance of all points. It begins with `comment`; each line of
/// `comment` must begin with #.
[[nodiscard]] std::string bar_toml(const calib::mfb::Bar& bar, std::string_view comment);

}  // namespace abbe::daemon
