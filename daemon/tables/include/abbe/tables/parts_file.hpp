#pragma once
/// parts.toml: the parts of a joint identification (`abbe identify joint`). Each part names files;
/// relative names are relative to the folder of parts.toml. Faults as in input_files.hpp.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/geometry/rigid_transform.hpp"

namespace abbe::daemon {

/// Table [[run]]: a run along a path, measured by a laser tracker.
struct RunFiles {
  std::string name;           ///< default: "run 1", "run 2", ...
  std::string path, tracker;  ///< files; both are given, or `recording`
  /// recording of the daemon with a run along a path, instead of `path` and `tracker`
  std::string recording;
  std::string encoder;  ///< empty: no scale readings
  /// Tool reference point to reflector; nullopt: [target] offset_mm of the machine.
  std::optional<calib::Vector3> target_offset_m{};
  /// Position of the tracker in machine coordinates, accurate to 0.5 m; nullopt: that of the
  /// configuration.
  std::optional<calib::Vector3> tracker_position_m{};
  /// Position of the tracker in the frame of the points x_mm, y_mm, z_mm (place_tracker()).
  std::optional<calib::Vector3> tracker_centre_m{};
  /// Name of the instrument. Runs with the same instrument have the same error of the range scale.
  std::string instrument = "tracker";
  /// Runs with the same text have the same offset of the ranges; empty: the run has its own offset.
  std::string range_offset{};
};

/// Table [[array]]: touches of a ball array, or errors at its balls.
struct ArrayFiles {
  std::string name;                 ///< default: "array 1", ...
  std::string touches, calibrator;  ///< files; both are given, or `errors`
  std::string errors;               ///< file of errors, instead of `touches` and `calibrator`
  /// Tool reference point to stylus tip; nullopt: [target] offset_mm of the machine.
  std::optional<calib::Vector3> tip_offset_m{};
  std::optional<int> positions{};  ///< required number of positions; nullopt: that of [evemu], or 8
  std::optional<double> artefact_C{};  ///< temperature of the array during the touches
  double u_artefact_K = 0.0;
  /// Standard deviation of a ball centre, per coordinate; 0: it is estimated from the residuals.
  double s_centre_m = 0.0;
};

/// Table [[bar]]: touches of a Multi-Feature Bar.
struct BarFiles {
  std::string name;               ///< default: "bar 1", ...
  std::string bar, plan, points;  ///< files as for `abbe identify mfb`
};

struct PartsFile {
  InputFile source;
  std::vector<RunFiles> runs;
  std::vector<ArrayFiles> arrays;
  std::vector<BarFiles> bars;
};

/// BadInput without a run, with fewer than two parts, if two parts have one name, or if runs with
/// the same range_offset have different instruments.
[[nodiscard]] Result<PartsFile> read_parts_toml(const std::filesystem::path& file);

}  // namespace abbe::daemon
