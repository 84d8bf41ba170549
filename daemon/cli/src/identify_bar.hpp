#pragma once
/// The identification of `abbe identify bar` and, after its touches, of `abbe calibrate bar`.

#include <string>

#include "abbe/calib/mfb/run/measurement.hpp"

namespace abbe::daemon {

struct IdentifyBarArguments {
  std::string bar, plan, points, gauge, out;
  bool json = false;
};

/// A measuring machine has no file: its readings may be anywhere.
[[nodiscard]] calib::MachineNodes nodes_of_measuring_machine();

/// Reads the files, writes bar.toml, prints the summary. Returns the exit code.
[[nodiscard]] int identify_bar(const IdentifyBarArguments& arguments);

}  // namespace abbe::daemon
