#pragma once
/// The part of `abbe identify bar` that `abbe calibrate bar` also uses, after its touches.

#include "abbe/tasks/identify_bar.hpp"

namespace abbe::daemon {

struct IdentifyBarCommand : IdentifyBarArguments {
  bool json = false;
};

/// Prints the summary. Returns the exit code.
[[nodiscard]] int run_identify_bar(const IdentifyBarCommand& arguments);

}  // namespace abbe::daemon
