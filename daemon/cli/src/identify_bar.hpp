#pragma once
/// What `abbe identify bar` does and, after its touches, `abbe calibrate bar`.

#include "abbe/tasks/identify_bar.hpp"

namespace abbe::daemon {

struct IdentifyBarCommand : IdentifyBarArguments {
  bool json = false;
};

/// Prints the summary. Returns the exit code.
[[nodiscard]] int run_identify_bar(const IdentifyBarCommand& arguments);

}  // namespace abbe::daemon
