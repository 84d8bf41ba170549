#pragma once
/// The command line for people: `abbe`. One file per subcommand in cli/src, joined in
/// cli/src/run_cli.cpp. Results go to stdout, everything else to stderr; progress and colour only
/// to a terminal (NO_COLOR switches colour off). Exit codes: 0 done, 1 the data do not allow an
/// answer, 2 usage, 3 bad input file, 4 input or output failed, 5 refused by the gate.

namespace abbe::daemon {

/// Runs one command to its end; returns the exit code. A subcommand that is a program of its own
/// (`abbe sim`: abbe-sim beside this program or in PATH) takes the place of this process.
[[nodiscard]] int run_cli(int argc, const char* const* argv);

}  // namespace abbe::daemon
