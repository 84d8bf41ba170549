#pragma once
/// Subcommands that are separate programs, as with git.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Replaces this process by the program whose name is "abbe-" followed by words[0]: the one in the
/// folder of this program, else the one in PATH. Returns only if it cannot be run (Io).
[[nodiscard]] Error exec_program(std::vector<std::string> words);

}  // namespace abbe::daemon
