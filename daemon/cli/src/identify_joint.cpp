// `abbe identify joint`: one model from several runs, ball arrays and bars that agree.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <memory>
#include <utility>
#include <variant>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/report/sections.hpp"
#include "abbe/tasks/joint_report.hpp"
#include "commands.hpp"
#include "earlier_words.hpp"
#include "identified_model.hpp"
#include "scales_corrected.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct IdentifyJointCommand : IdentifyJointArguments {
  std::string out, pdf;
  bool json = false;
};

Error contradiction_of(std::vector<std::string> contradictions) {
  return {ErrorCode::DataInsufficient,
          "identify joint: the parts contradict each other, there is no joint model. Correct the "
          "part that is wrong, or leave it out",
          std::move(contradictions)};
}

void print_joint_summary(const JointOutcome& outcome, const std::filesystem::path& folder) {
  fmt::print("model       {}  ({} tables, tool and machine \"{}\")\n", model_id(outcome.document),
             outcome.joint.model.tables()->layout().tables().size(), outcome.document.machine);
  for (std::size_t k = 0; k < outcome.input.facts.size(); ++k) {
    const PartFacts& part = outcome.input.facts[k];
    const auto& share = outcome.contributions[k];
    fmt::print("part        {} ({}): {} observations; u alone {}, of all others {}\n", part.name,
               part.method, part.observations, u_text(share.u_alone_m), u_text(share.u_without_m));
  }
  for (const calib::joint::PairTest& pair : outcome.pairs)
    fmt::print("agreement   {}: chi-square {:.2f}, {} degrees of freedom, p {:.3g}\n",
               names_of(outcome.input, pair), pair.all.statistic, pair.all.dof, pair.all.p);
  fmt::print("uncertainty {} of all parts, rank {}, condition {:.3g}\n",
             um_text(u_of_joint_m(outcome), 3), outcome.joint.rank, outcome.joint.condition);
  print_verdict(outcome.verdict);
  fmt::print("written     {}, tables.csv, report.html\n", (folder / "model.json").string());
}

int write_and_print(const IdentifyJointCommand& arguments, const JointOutcome& outcome,
                    ProgressBar& bar) {
  const ModelDocument& document = outcome.document;
  if (const auto done = write_and_keep(
          {arguments.out, arguments.keep, "abbe identify joint", arguments.pdf}, document,
          outcome.verdict, {{"tables.csv", to_tables_csv(document.model)}}, bar.progress());
      !done) {
    bar.clear();
    return report(done.error());
  }
  bar.clear();

  if (arguments.json)
    fmt::print("{}\n", indented_json_text(joint_json(outcome, arguments.out)));
  else
    print_joint_summary(outcome, arguments.out);
  return exit_code(outcome.verdict);
}

int report_contradiction(JointContradiction& found, bool json) {
  auto& [input, identified] = found;
  if (json)
    fmt::print("{}\n", indented_json_text(
                           nlohmann::json{{"pairs", pairs_json(input, identified.pairs)},
                                          {"directed", directed_json(input, identified.directed)},
                                          {"contradictions", identified.contradictions}}));
  return report(contradiction_of(std::move(identified.contradictions)));
}

int run_joint(const IdentifyJointCommand& arguments) {
  ProgressBar bar;
  auto found = identify_joint(arguments, bar.progress());
  bar.clear();
  if (!found) return report(found.error());
  if (auto* contradiction = std::get_if<JointContradiction>(&*found))
    return report_contradiction(*contradiction, arguments.json);
  return write_and_print(arguments, std::get<JointOutcome>(*found), bar);
}

void add_joint_options(CLI::App& command, IdentifyJointCommand& arguments) {
  command
      .add_option("--machine", arguments.machine,
                  "machine.toml or the daemon's abbed.toml, for all parts")
      ->required();
  command
      .add_option("--parts", arguments.parts,
                  "parts.toml: [[run]], [[array]] and [[bar]] tables with the files of each part;\n"
                  "`abbe example parts.toml` prints a commented one")
      ->required();
  command
      .add_option("--estimator", arguments.estimator,
                  "of the runs: two-step or simultaneous; default: that of [otf], or simultaneous")
      ->transform(estimator_word, "")
      ->check(CLI::IsMember({"two-step", "simultaneous"}));
  command
      .add_option("--u-scale-ppm", arguments.u_scale_ppm,
                  "relative standard uncertainty common to all ranges of one tracker, ppm;\n"
                  "default: that of " +
                      tables_with(Capability::TrackerPoints) + ", or 0")
      ->check(CLI::NonNegativeNumber);
  command
      .add_option("--false-alarm", arguments.false_alarm,
                  "probability that parts of one machine are refused; all tests together")
      ->check(CLI::Range(1e-12, 0.5))
      ->capture_default_str();
  command.add_flag("--accept-path-orientation", arguments.accept_path_orientation,
                   "do not refuse the model because a path might be rotated by 180 degrees");
  add_scales_corrected(command, arguments.scales_corrected);
  add_result_options(command, {arguments.keep, arguments.json, arguments.out, arguments.pdf});
}

}  // namespace

void add_identify_joint(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyJointCommand>();
  auto* command = parent.add_subcommand(
      "joint",
      "Identify one model from several runs with a laser tracker (also from several places), ball\n"
      "arrays and Multi-Feature Bars touched on the same machine. Every pair of parts is tested "
      "in\n"
      "what both determine, every part in its lengths and squareness. Parts that contradict each\n"
      "other give no model (exit code 1); the message names what explains it: length, squareness,\n"
      "sign, unit, axes, tool, tables. Else model.json, tables.csv and report.html are written to\n"
      "OUT. The model is nowhere less certain than that of a part.\n"
      "Exit code 5 if the gate would refuse the model; the files are written in any case.");
  add_joint_options(*command, *arguments);
  command->callback([arguments, &exit] { exit = run_joint(*arguments); });
}

}  // namespace abbe::daemon
