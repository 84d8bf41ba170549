#include "abbe/cli/cli.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/option_values.hpp"
#include "commands.hpp"
#include "dds_keys.hpp"
#include "earlier_words.hpp"
#include "examples.hpp"
#include "known_commands.hpp"
#include "run_program.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

std::string footer() {
  return "Separate programs: `abbe demo`, `abbe sim ...` and `abbe watch ...` run abbe-demo, "
         "abbe-sim\nand abbe-watch.\n" +
         exit_codes_text(
             {{ExitCode::Done},
              {ExitCode::DataInsufficient,
               "the data do not allow an answer (rank, alignment, too few points), or a replay "
               "gave another model"},
              {ExitCode::Usage},
              {ExitCode::BadInput},
              {ExitCode::Io},
              {ExitCode::Refused,
               "refused by the gate, or because of the state of the daemon or of the model store"},
              {ExitCode::StopNotConfirmed},
              {ExitCode::StopNotSent},
              {ExitCode::Worse},
              {ExitCode::Interrupted,
               "interrupted while following a calibration, which continues"}}) +
         "\nUnits: lengths mm, small errors um, angles rad or urad, times s; every column and key\n"
         "names its unit.";
}

/// Subcommands that are separate programs, as with git.
constexpr std::array<std::string_view, 3> kPrograms{"demo", "sim", "watch"};

void add_commands(CLI::App& app, int& exit) {
  add_status(app, exit);
  auto* calibrate = app.add_subcommand("calibrate", "Calibrate the machine of the running daemon");
  calibrate->require_subcommand(1);
  add_calibrate_otf(*calibrate, exit);
  add_calibrate_evemu(*calibrate, exit);
  add_calibrate_mfb(*calibrate, exit);
  add_calibrate_probe(*calibrate, exit);
  add_calibrate_artefact(*calibrate, exit);
  add_calibrate_bar(*calibrate, exit);
  auto* plan = app.add_subcommand("plan", "Plan a calibration before the machine moves");
  plan->require_subcommand(1);
  add_plan_otf(*plan, exit);
  add_plan_mfb(*plan, exit);
  add_reference(app, exit);
  add_sensors(app, exit);
  add_machine(app, exit);
  add_tracker(app, exit);
  add_probe_lines(app, exit);
  add_replay(app, exit);
  auto* identify = app.add_subcommand(
      "identify", "Identify a machine's geometric errors, or an artefact, from recorded files");
  identify->require_subcommand(1);
  add_identify_otf(*identify, exit);
  add_identify_evemu(*identify, exit);
  add_identify_mfb(*identify, exit);
  add_identify_bar(*identify, exit);
  add_identify_joint(*identify, exit);
  add_identify_artefact(*identify, exit);
  add_verify(app, exit);
  add_report(app, exit);
  auto* model =
      app.add_subcommand("model", "Evaluate models, and manage the model store of a machine");
  model->require_subcommand(1);
  add_model_eval(*model, exit);
  add_model_compare(*model, exit);
  add_model_drift(*model, exit);
  add_model_list(*model, exit);
  add_model_show(*model, exit);
  add_model_add(*model, exit);
  add_model_activate(*model, exit);
  add_model_rollback(*model, exit);
  add_model_prune(*model, exit);
  add_export(app, exit);
  auto* dds = app.add_subcommand("dds", "Set up DDS Security");
  dds->require_subcommand(1);
  add_dds_keys(*dds, exit);
  add_example(app, exit);
}

/// The command that the words name, as far as they match a command: "abbe calibrate otf".
std::pair<const CLI::App*, std::string> named_command(const CLI::App& app) {
  const CLI::App* command = &app;
  std::string name = "abbe";
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().back();
    name += " " + command->get_name();
  }
  return {command, name};
}

/// The Error for an invalid command line; it contains the help of the command that was typed.
Error usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const auto [command, name] = named_command(app);
  const std::string help = fmt::format("see `{} --help`", name);
  const auto below = command->get_subcommands([](const CLI::App*) { return true; });
  const bool command_missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr &&
                               !below.empty() && command->get_require_subcommand_min() > 0;
  if (command == &app || !command_missing) return {ErrorCode::Usage, error.what(), {help}};

  Error needs{ErrorCode::Usage, fmt::format("{} needs one of its commands", name), {}};
  for (const CLI::App* each : below) {
    const std::string all = each->get_description();
    needs.details.push_back(
        fmt::format("{} {}: {}", name, each->get_name(), all.substr(0, all.find('\n'))));
  }
  needs.details.push_back(help);
  return needs;
}

int parse_and_run(const std::vector<std::string>& words) {
  int exit = 0;
  CLI::App app{
      "abbe identifies the geometric errors of machine tools and measuring machines, and stores "
      "the models."};
  app.name("abbe");
  app.set_version_flag("--version", "abbe " ABBE_VERSION);
  app.footer(footer());
  app.require_subcommand(1);
  add_commands(app, exit);
  add_examples(app);
  check_option_values(app);

  const std::vector<std::string> programs{kPrograms.begin(), kPrograms.end()};
  if (asks_for_help(words)) {
    if (const auto unknown = unknown_command(app, words, programs)) return report(*unknown);
  }

  try {
    app.parse(option_words(app, present_options(words)));
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    if (const auto unknown = unknown_command(app, words, programs)) return report(*unknown);
    return report(usage_error(app, error));
  }

  return exit;
}

}  // namespace

int run_cli(int argc, const char* const* argv) {
  try {
    auto words = command_line(argc, argv);
    if (!words.empty() &&
        std::find(kPrograms.begin(), kPrograms.end(), words.front()) != kPrograms.end())
      return report(exec_program(std::move(words)));
    return parse_and_run(words);
  } catch (const std::exception& exception) {
    return report({ErrorCode::Io, exception.what()});
  }
}

}  // namespace abbe::daemon
