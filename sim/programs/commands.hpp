#pragma once
/// The subcommands of abbe-sim. Each add function adds a subcommand to the command line and returns
/// the function that runs it; its result is an exit code.

#include <functional>
#include <string_view>

#include "abbe/protocol/exit_codes.hpp"
#include "abbe/sim/error.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name of CLI11
class App;
}

namespace abbe::sim {

inline constexpr int kDone = number(protocol::ExitCode::Done);

struct Subcommand {
  CLI::App* app = nullptr;
  std::function<int()> run;
};

[[nodiscard]] Subcommand add_run(CLI::App& app);
[[nodiscard]] Subcommand add_truth(CLI::App& app);
[[nodiscard]] Subcommand add_machine(CLI::App& app);
[[nodiscard]] Subcommand add_replay(CLI::App& app);
[[nodiscard]] Subcommand add_evemu(CLI::App& app);
[[nodiscard]] Subcommand add_mfb(CLI::App& app);
[[nodiscard]] Subcommand add_bar(CLI::App& app);
[[nodiscard]] Subcommand add_set(CLI::App& app);

/// Writes the files of `abbe-sim mfb`, with the default of every option. Returns an exit code.
[[nodiscard]] int write_bar_set(const std::string& folder);

/// Prints "abbe-sim: " and the text of the error to stderr; returns the exit code of the error.
int report(const Error& error);

}  // namespace abbe::sim
