/// abbe-sim: a machine with known errors and the instruments around it, on real sockets.

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "abbe/protocol/option_values.hpp"
#include "abbe/protocol/option_words.hpp"
#include "abbe/protocol/printable.hpp"
#include "commands.hpp"

namespace abbe::sim {

namespace {

using protocol::exit_codes_text;
using protocol::ExitCode;

constexpr int kUsage = number(ExitCode::Usage), kBadInput = number(ExitCode::BadInput),
              kIoFailed = number(ExitCode::Io);

}  // namespace

int report(const Error& error) {
  std::fprintf(stderr, "abbe-sim: %s\n", protocol::printable(error.text).c_str());
  switch (error.code) {
    case ErrorCode::BadInput:
      return kBadInput;
    case ErrorCode::Io:
      return kIoFailed;
    case ErrorCode::Usage:
      return kUsage;
  }
  return kIoFailed;
}

namespace {

std::string footer() {
  return exit_codes_text({{ExitCode::Done},
                          {ExitCode::Usage},
                          {ExitCode::BadInput},
                          {ExitCode::Io, "input or output failed (file, port in use)"}}) +
         "\n"
         "A machine file is a TOML file with the tables [machine], [axes.X|Y|Z] and [target], for "
         "example\n"
         "the daemon's abbed.toml. Also read from it: [tracker] port, [encoder] peer_port and "
         "nodes,\n"
         "[daemon] speed.";
}

struct Example {
  const char* command;
  const char* arguments;
};

constexpr std::array kExamples{
    Example{"run", "--machine machine.toml --path path.csv --truth-out truth.csv"},
    Example{"truth", "--machine machine.toml --points points.csv -o truth.csv"},
    Example{"machine", "--machine machine.toml --seed 3 -o errors.csv"},
    Example{"replay", "run.mcap --speed 10"},
    Example{"evemu", "--machine machine.toml --calibrator-out calibrator.toml"},
    Example{"mfb", "--seed 3 --drift-um 2 -o run"},
    Example{"bar", "--bar-seed 3 --repeats 5 -o calibration"},
    Example{"set", "otf -o first"}};

/// Puts an example before the footer of every subcommand.
void add_examples(CLI::App& app) {
  for (const Example& example : kExamples) {
    CLI::App* sub = app.get_subcommand(example.command);
    sub->footer(std::string("Example: abbe-sim ") + example.command + " " + example.arguments +
                "\n" + sub->get_footer());
  }
}

int run(int argc, char** argv) {
  CLI::App app{"Simulated machine tool, laser tracker and encoders with errors that are known",
               "abbe-sim"};
  app.require_subcommand(1);
  app.footer(footer());
  app.set_version_flag("--version", "abbe-sim " ABBE_VERSION);
  const std::vector<Subcommand> commands{add_run(app),    add_truth(app), add_machine(app),
                                         add_replay(app), add_evemu(app), add_mfb(app),
                                         add_bar(app),    add_set(app)};
  add_examples(app);

  try {
    protocol::check_option_values(app);
    app.parse(protocol::option_words(app, {argv + 1, argv + argc}));
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kDone : kUsage;
  }

  for (const Subcommand& command : commands) {
    if (command.app->parsed()) return command.run();
  }

  return kUsage;
}

}  // namespace
}  // namespace abbe::sim

int main(int argc, char** argv) {
  try {
    return abbe::sim::run(argc, argv);
  } catch (const std::exception& e) {  // for example out of memory: the program cannot continue
    std::fprintf(stderr, "abbe-sim: %s\n", e.what());
    return abbe::sim::kIoFailed;
  }
}
