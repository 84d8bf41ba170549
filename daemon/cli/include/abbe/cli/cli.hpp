#pragma once
/// The command line program `abbe`. Each subcommand has its own file in cli/src;
/// cli/src/run_cli.cpp joins them. Results go to stdout, everything else to stderr; progress and
/// colour only to a terminal (NO_COLOR switches colour off). Exit codes: abbe/base/exit_codes.hpp.

namespace abbe::daemon {

/// Runs one command to its end; returns the exit code. A subcommand that is a separate program
/// (`abbe sim`: abbe-sim in the folder of this program or in PATH) replaces this process.
[[nodiscard]] int run_cli(int argc, const char* const* argv);

}  // namespace abbe::daemon
