#include "abbe/cli/cli.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "commands.hpp"
#include "dds_keys.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

constexpr std::string_view kFooter =
    "Separate programs: `abbe sim ...` runs abbe-sim, `abbe watch ...` runs abbe-watch.\n"
    "Exit codes: 0 done; 1 the data do not allow an answer (rank, alignment, too few points), or\n"
    "a replay gave another model; 2 usage; 3 invalid input file; 4 input or output failed;\n"
    "5 refused by the gate, or because of the state of the daemon; 130 interrupted while\n"
    "following a calibration, which continues.\n"
    "Units: lengths mm, small errors um, angles rad or urad, times s; every column and key names\n"
    "its unit.";

/// Subcommands that are separate programs, as with git.
constexpr std::array<std::string_view, 2> kPrograms{"sim", "watch"};

std::filesystem::path own_folder() {
  std::error_code ignored;
  return std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path();
}

/// Replaces this process by the program. Returns only if the program cannot be run.
Error exec_program(std::string_view name, int argc, const char* const* argv) {
  const auto program = fmt::format("abbe-{}", name);
  const auto beside = (own_folder() / program).string();
  std::vector<std::string> words{program};
  for (int i = 2; i < argc; ++i) words.emplace_back(argv[i]);
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  ::execv(beside.c_str(), arguments.data());
  ::execvp(program.c_str(), arguments.data());
  return {ErrorCode::Io, fmt::format("run {}: neither in the folder of abbe nor in PATH: {}",
                                     program, std::strerror(errno))};
}

void add_commands(CLI::App& app, int& exit) {
  add_status(app, exit);
  auto* calibrate =
      app.add_subcommand("calibrate", "Calibrate the machine of the running daemon");
  calibrate->require_subcommand(1);
  add_calibrate_otf(*calibrate, exit);
  add_calibrate_evemu(*calibrate, exit);
  add_calibrate_probe(*calibrate, exit);
  add_calibrate_artefact(*calibrate, exit);
  add_reference(app, exit);
  add_machine(app, exit);
  add_tracker(app, exit);
  add_replay(app, exit);
  auto* identify = app.add_subcommand(
      "identify", "Identify a machine's geometric errors, or an artefact, from recorded files");
  identify->require_subcommand(1);
  add_identify_otf(*identify, exit);
  add_identify_evemu(*identify, exit);
  add_identify_artefact(*identify, exit);
  add_verify(app, exit);
  auto* model = app.add_subcommand(
      "model", "Evaluate models, and manage the model store of a machine");
  model->require_subcommand(1);
  add_model_eval(*model, exit);
  add_model_compare(*model, exit);
  add_model_list(*model, exit);
  add_model_show(*model, exit);
  add_model_activate(*model, exit);
  add_model_rollback(*model, exit);
  auto* dds = app.add_subcommand("dds", "Set up DDS Security");
  dds->require_subcommand(1);
  add_dds_keys(*dds, exit);
}

int parse_and_run(int argc, const char* const* argv) {
  int exit = 0;
  CLI::App app{
      "abbe identifies the geometric errors of machine tools and measuring machines, and stores "
      "the models."};
  app.name("abbe");
  app.set_version_flag("--version", "abbe " ABBE_VERSION);
  app.footer(std::string{kFooter});
  app.require_subcommand(1);
  add_commands(app, exit);

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return report(
        {ErrorCode::Usage, error.what(), {"see `abbe --help`, or --help after any command"}});
  }

  return exit;
}

}  // namespace

int run_cli(int argc, const char* const* argv) {
  try {
    const std::string_view first = argc > 1 ? argv[1] : "";
    if (std::find(kPrograms.begin(), kPrograms.end(), first) != kPrograms.end())
      return report(exec_program(first, argc, argv));
    return parse_and_run(argc, argv);
  } catch (const std::exception& exception) {
    return report({ErrorCode::Io, exception.what()});
  }
}

}  // namespace abbe::daemon
