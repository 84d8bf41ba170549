#pragma once
/// Calibrates a Multi-Feature Bar by reversal on a measuring machine.

#include <cstddef>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/input_file.hpp"
#include "abbe/calib/mfb/identify/bar_calibration.hpp"
#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::daemon {

/// File names; `out` is the bar.toml to write.
struct IdentifyBarArguments {
  std::string bar, plan, points, gauge, out;
};

struct IdentifiedBar {
  calib::mfb::BarCalibration calibration;
  std::vector<InputFile> sources;
  std::size_t repeats = 0;  ///< number of normal passes; the number of reversed passes is the same
};

/// Nodes for a measuring machine. There is no file that describes the machine, so its readings may
/// have any value.
[[nodiscard]] calib::MachineNodes nodes_of_measuring_machine();

/// Reads the files and writes `arguments.out`. Errors name file and line.
[[nodiscard]] Result<IdentifiedBar> identify_bar(const IdentifyBarArguments& arguments);

}  // namespace abbe::daemon
