#pragma once
/// Reads the files of a calibration with a Multi-Feature Bar and converts to SI: the bar, the plan
/// of its measurements, and the touches. Faults as in input_files.hpp: all of a file at once, with
/// file, line and key or column; a file with a fault is not used at all. The functions may be
/// called from any thread.

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/geometry/axis_table.hpp"
#include "abbe/calib/mfb/run/bar.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

/// bar.toml: [bar], [pattern], [[point]], and if given [calibration] and [sag].
struct BarFile {
  InputFile source;
  calib::mfb::Bar bar;
};
[[nodiscard]] Result<BarFile> read_bar_toml(const std::filesystem::path& file);
/// Same as read_bar_toml() for the text of a file; `file` is its name in messages.
[[nodiscard]] Result<BarFile> parse_bar_toml(std::string_view text,
                                             const std::filesystem::path& file);

/// plan.toml: [plan], [noise], [[measurement]]. If `bar` has a thermal expansion, every measurement
/// needs temperature_C.
struct BarPlanFile {
  InputFile source;
  calib::mfb::Plan plan;
  std::vector<std::size_t> lines;  ///< line in the file, one per measurement
};
[[nodiscard]] Result<BarPlanFile> read_bar_plan_toml(const std::filesystem::path& file,
                                                     const calib::mfb::Bar& bar);
[[nodiscard]] Result<BarPlanFile> parse_bar_plan_toml(std::string_view text,
                                                      const std::filesystem::path& file,
                                                      const calib::mfb::Bar& bar);

/// The touches: `measurement,feature,index,side,k,x_mm,y_mm,z_mm`, scale readings. They must belong
/// to the measurements of `plan` and to the pattern of `bar`, and lie at most half a node spacing
/// outside `nodes`.
struct BarPointsFile {
  InputFile source;
  std::vector<calib::mfb::PassTouches> passes;  ///< one per measurement of the plan
  /// line of each touch in the file, in the order of `passes`
  std::vector<std::vector<std::size_t>> lines;
  /// One text with file, line and column for each measurement whose rows run against the direction
  /// of its `pass`. This is not yet a fault of the file, because a bar that is clamped turned looks
  /// the same.
  std::vector<std::string> against_pass;
};
[[nodiscard]] Result<BarPointsFile> read_bar_points_csv(const std::filesystem::path& file,
                                                        const calib::mfb::Bar& bar,
                                                        const BarPlanFile& plan,
                                                        const calib::MachineNodes& nodes);

/// Adds to the checks of load_config() what an identification with a bar needs: at least four nodes
/// on every axis for cubic tables. `file`: file of `machine`, for messages.
[[nodiscard]] Result<void> check_bar_machine(const std::filesystem::path& file,
                                             const MachineConfig& machine);

}  // namespace abbe::daemon
