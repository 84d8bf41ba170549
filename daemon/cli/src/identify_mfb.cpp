// `abbe identify mfb`: the 21 errors of three linear axes from a Multi-Feature Bar.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe/base/json_text.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/identify_mfb.hpp"
#include "commands.hpp"
#include "earlier_words.hpp"
#include "identified_model.hpp"
#include "mfb_summary.hpp"
#include "scales_corrected.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

struct IdentifyMfbCommand : IdentifyMfbArguments {
  std::string out, pdf;
  bool json = false;
};

int run(const IdentifyMfbCommand& arguments) {
  ProgressBar bar;
  const auto outcome = identify_mfb(arguments, bar.progress());
  bar.clear();
  if (!outcome) return report(outcome.error());
  const auto& [candidate, document] = *outcome;
  if (const auto done = write_and_keep(
          {arguments.out, arguments.keep, "abbe identify mfb", arguments.pdf}, document,
          candidate.verdict, {{"tables.csv", to_tables_csv(document.model)}}, bar.progress());
      !done) {
    bar.clear();
    return report(done.error());
  }
  bar.clear();

  if (arguments.json)
    fmt::print("{}\n", indented_json_text(mfb_json(document, candidate, arguments.out)));
  else
    print_mfb_summary(document, candidate, arguments.out);
  return exit_code(candidate.verdict);
}

void add_options(CLI::App& command, IdentifyMfbCommand& arguments) {
  auto* machine =
      command.add_option("--machine", arguments.machine, "machine.toml or the daemon's abbed.toml");
  auto* bar = command.add_option("--bar", arguments.bar, "bar.toml: the calibrated bar");
  auto* plan =
      command.add_option("--plan", arguments.plan,
                         "plan.toml: where the bar stood, with which tool it was probed, noise");
  auto* points =
      command
          .add_option(
              "--points", arguments.points,
              "touches: measurement,feature,index,side,k,x_mm,y_mm,z_mm; scale readings.\n"
              "`abbe example bar.toml`, plan.toml and barpoints.csv print commented examples")
          ->needs(machine)
          ->needs(bar)
          ->needs(plan);
  auto* recording = command
                        .add_option("--recording", arguments.recording,
                                    "instead of files, a recording of the daemon (.mcap): its last "
                                    "complete run with\na bar, with the recorded configuration "
                                    "unless --machine is given")
                        ->excludes(points)
                        ->excludes(bar)
                        ->excludes(plan);
  command
      .add_option(
          "--estimator", arguments.estimator,
          "simultaneous: one weighted least-squares adjustment of all touches; sequential: as\n"
          "published, angles, then translations, then squareness; without the roll slope\n"
          "of X")
      ->transform(estimator_word, "")
      ->check(CLI::IsMember({"simultaneous", "sequential"}))
      ->capture_default_str();
  auto* trials = command
                     .add_option("--monte-carlo", arguments.trials,
                                 "check the uncertainties with this number of trials")
                     ->check(CLI::Range(2, 1000000));
  command.add_option("--seed", arguments.seed, "of the Monte Carlo trials")
      ->needs(trials)
      ->capture_default_str();
  recording->excludes(add_scales_corrected(command, arguments.scales_corrected));
  add_accept_option(command, arguments.accept);
  add_result_options(command, {arguments.keep, arguments.json, arguments.out, arguments.pdf});
}

}  // namespace

void add_identify_mfb(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyMfbCommand>();
  auto* command = parent.add_subcommand(
      "mfb",
      "Identify all 21 errors of three linear axes from a Multi-Feature Bar probed in several\n"
      "positions. Writes model.json, tables.csv and report.html to OUT and prints how well the\n"
      "model predicts measurements that were not used in the fit. Exit code 5 if the gate would\n"
      "refuse the model; the files are written in any case.");
  add_options(*command, *arguments);
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
