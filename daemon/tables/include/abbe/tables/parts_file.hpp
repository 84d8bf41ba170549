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

/// [[run]]: a drive along a path, measured by a laser tracker.
struct RunFiles {
  std::string name;           ///< default: "run 1", "run 2", ...
  std::string path, tracker;  ///< both, or
  std::string recording;      ///< instead of them: file of the daemon with a run along a path
  std::string encoder;        ///< empty: no scale readings
  /// Tool reference point to reflector; nullopt: [target] offset_mm of the machine.
  std::optional<calib::Vector3> target_offset_m{};
  /// Place of the tracker in machine coordinates, to 0.5 m; nullopt: that of the configuration.
  std::optional<calib::Vector3> tracker_position_m{};
  /// The tracker in the frame of points x_mm, y_mm, z_mm (place_tracker()).
  std::optional<calib::Vector3> tracker_centre_m{};
  /// Runs with the same instrument have the same error of the scale of its ranges.
  std::string instrument = "tracker";
  /// Runs with the same text have the same offset of the ranges; empty: its own.
  std::string range_offset{};
};

/// [[array]]: touches of a ball array, or errors at its balls.
struct ArrayFiles {
  std::string name;                 ///< default: "array 1", ...
  std::string touches, calibrator;  ///< both, or
  std::string errors;               ///< instead of them
  /// Tool reference point to stylus tip; nullopt: [target] offset_mm of the machine.
  std::optional<calib::Vector3> tip_offset_m{};
  std::optional<int> positions{};      ///< required number; nullopt: that of [evemu], or 8
  std::optional<double> artefact_C{};  ///< temperature of the array during the touches
  double u_artefact_K = 0.0;
  /// Standard deviation of a ball centre, per coordinate; 0: estimated from the residuals.
  double s_centre_m = 0.0;
};

/// [[bar]]: touches of a Multi-Feature Bar.
struct BarFiles {
  std::string name;               ///< default: "bar 1", ...
  std::string bar, plan, points;  ///< as for `abbe identify mfb`
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
