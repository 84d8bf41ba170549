// `abbe identify joint`: one model from several runs, ball arrays and bars that agree.
#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <chrono>
#include <memory>
#include <utility>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/methods/run_figures.hpp"
#include "abbe/result/try.hpp"
#include "commands.hpp"
#include "identified_model.hpp"
#include "identify_otf.hpp"
#include "joint_input.hpp"
#include "joint_report.hpp"
#include "scales_corrected.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

namespace joint = calib::joint;

ModelStatistics joint_statistics(const JointInput& input, const joint::JointModel& model,
                                 const calib::HeldOutFigures& held_out) {
  ModelStatistics s;
  for (const PartFacts& part : input.facts) s.observations += part.observations;
  s.unknowns = input.common->basis.size() + model.effects.size();
  s.rank = model.rank;
  s.condition = model.condition;
  s.sigma0 = held_out.candidate;
  s.chi2_per_dof = held_out.candidate * held_out.candidate;
  s.before.rms_m = held_out.no_compensation_rms_m;
  s.after.rms_m = held_out.candidate_rms_m;
  s.iterations = 1;
  s.stop_reason = "direct";
  return s;
}

ModelDocument joint_document(const JointInput& input, const joint::JointModel& model,
                             const calib::Verdict& verdict) {
  return {model.model,
          "joint",
          "joint",
          input.config.machine.name,
          machine_hash(input.config),
          std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now()),
          joint_statistics(input, model, verdict.held_out),
          input.sources};
}

Error contradiction_of(std::vector<std::string> contradictions) {
  return {ErrorCode::DataInsufficient,
          "identify joint: the parts contradict each other, there is no joint model. Correct the "
          "part that is wrong, or leave it out",
          std::move(contradictions)};
}

/// The model of all parts with its verdict; `identified` has no contradiction.
Result<JointOutcome> judged(const IdentifyJointArguments& arguments, const JointInput& input,
                            joint::JointIdentification identified, ProgressBar& bar) {
  const auto active = active_model(arguments.keep);
  ABBE_TRY(active);
  const auto other = comparison_model(*active, input.config);
  calib::otf::Options options = otf_options({}, input.config);
  if (arguments.estimator)
    options.estimator = calib::otf::estimator(*arguments.estimator).value_or(options.estimator);
  options.progress = [&](calib::otf::Stage stage, double fraction) {
    bar.show(words(stage), fraction);
  };

  auto verdict = joint::judge(*identified.joint, input.parts, input.runs, *input.common,
                              other.model, gate_limits(input.config.gate), options);
  if (!verdict) return tl::make_unexpected(error_of(verdict.error()));
  for (const PartFacts& part : input.facts)
    joint::add_verdict_of_part(*verdict, part.name, part.verdict);
  other.add_note(*verdict);
  auto contributions = joint::contributions(input.parts, *input.common);
  if (!contributions) return tl::make_unexpected(error_of(contributions.error()));

  auto document = joint_document(input, *identified.joint, *verdict);
  document.configuration = input.config.meaning;
  document.run = run_figures(*verdict, "legs");
  JointOutcome outcome{input,
                       std::move(identified.pairs),
                       std::move(identified.directed),
                       *std::move(identified.joint),
                       std::move(*contributions),
                       std::move(*verdict),
                       std::move(document)};
  outcome.document.run->tables = joint_tables(outcome);
  for (const calib::otf::Observations& run : input.observations)
    outcome.document.run->places_m.push_back(run.vertices_m);
  return outcome;
}

int write_and_print(const IdentifyJointArguments& arguments, const JointOutcome& outcome) {
  const ModelDocument& document = outcome.document;
  if (const auto done =
          write_and_keep({arguments.out, arguments.keep, "abbe identify joint"}, document,
                         outcome.verdict, {{"tables.csv", to_tables_csv(document.model)}});
      !done)
    return report(done.error());

  if (arguments.json)
    fmt::print("{}\n", indented_json_text(joint_json(outcome, arguments.out)));
  else
    print_joint_summary(outcome, arguments.out);
  return exit_code(outcome.verdict);
}

int run_joint(const IdentifyJointArguments& arguments) {
  ProgressBar bar;
  const auto input = read_joint_input(arguments, bar);
  bar.clear();
  if (!input) return report(input.error());
  auto identified =
      joint::identify(input->parts, *input->common, {.false_alarm = arguments.false_alarm});
  if (!identified) return report(error_of(identified.error()));
  if (!identified->joint) {
    if (arguments.json)
      fmt::print("{}\n", indented_json_text(nlohmann::json{
                             {"pairs", pairs_json(*input, identified->pairs)},
                             {"directed", directed_json(*input, identified->directed)},
                             {"contradictions", identified->contradictions}}));
    return report(contradiction_of(std::move(identified->contradictions)));
  }

  const auto outcome = judged(arguments, *input, std::move(*identified), bar);
  bar.clear();
  return outcome ? write_and_print(arguments, *outcome) : report(outcome.error());
}

void add_joint_options(CLI::App& command, IdentifyJointArguments& arguments) {
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
                  "of the runs: two-step or joint; default: that of [otf], or joint")
      ->check(CLI::IsMember({"two-step", "joint"}));
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
  add_result_options(command, arguments.keep, arguments.json, arguments.out);
}

}  // namespace

void add_identify_joint(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyJointArguments>();
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
