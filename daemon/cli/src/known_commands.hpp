#pragma once
/// Words on the command line that are no commands, and `abbe help`.

#include <CLI/App.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// The arguments after the program name. `help A B` becomes `A B --help`, `help` becomes `--help`.
[[nodiscard]] std::vector<std::string> command_line(int argc, const char* const* argv);

/// True if the last word is `--help` or `-h`. CLI11 then prints the help of the last command that
/// it recognised and ignores the words after it.
[[nodiscard]] bool asks_for_help(const std::vector<std::string>& words);

/// The error for the first word that is neither a subcommand nor an argument of one; it names the
/// nearest subcommand. `programs` are further commands of the first level.
[[nodiscard]] std::optional<Error> unknown_command(const CLI::App& app,
                                                   const std::vector<std::string>& words,
                                                   const std::vector<std::string>& programs);

}  // namespace abbe::daemon
