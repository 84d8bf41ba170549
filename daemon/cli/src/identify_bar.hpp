#pragma once
/// The identification of `abbe identify bar` and, after its touches, of `abbe calibrate bar`.

#include <string>

namespace abbe::daemon {

struct IdentifyBarArguments {
  std::string bar, plan, points, gauge, out;
  bool json = false;
};

/// Reads the files, writes bar.toml, prints the summary. Returns the exit code.
[[nodiscard]] int identify_bar(const IdentifyBarArguments& arguments);

}  // namespace abbe::daemon
