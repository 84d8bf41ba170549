#pragma once
/// The subcommands of abbe-sim. Each adds itself to the command line and returns what runs it; the
/// result is an exit code.

#include <functional>
#include <string_view>

#include "abbe/sim/error.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name of CLI11
class App;
}

namespace abbe::sim {

inline constexpr int kDone = 0;
inline constexpr int kUsage = 2;
inline constexpr int kBadInput = 3;
inline constexpr int kIoFailed = 4;

struct Subcommand {
  CLI::App* app = nullptr;
  std::function<int()> run;
};

[[nodiscard]] Subcommand add_run(CLI::App& app);
[[nodiscard]] Subcommand add_truth(CLI::App& app);
[[nodiscard]] Subcommand add_machine(CLI::App& app);
[[nodiscard]] Subcommand add_replay(CLI::App& app);
[[nodiscard]] Subcommand add_evemu(CLI::App& app);

/// "abbe-sim: " and the text on stderr; the exit code for it.
int report(const Error& error);

}  // namespace abbe::sim
