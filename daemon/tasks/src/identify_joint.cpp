#include "abbe/tasks/identify_joint.hpp"

#include <utility>

#include "abbe/base/wall_clock.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/methods/run_figures.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "abbe/tasks/identify_otf.hpp"
#include "abbe/tasks/joint_report.hpp"
#include "argument_checks.hpp"

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
          utc_now(),
          joint_statistics(input, model, verdict.held_out),
          input.sources};
}

/// The model of all parts with its verdict. Requires that `identified` has no contradiction.
Result<JointOutcome> judged(const IdentifyJointArguments& arguments, JointInput input,
                            joint::JointIdentification identified, const Progress& progress) {
  const auto active = active_model(arguments.keep);
  ABBE_TRY(active);
  const auto other = comparison_model(*active, input.config);
  calib::otf::Options options = otf_options({}, input.config);
  if (arguments.estimator)
    options.estimator = calib::otf::estimator(*arguments.estimator).value_or(options.estimator);
  options.progress = [&](calib::otf::Stage stage, double fraction) {
    progress.show(words(stage), fraction);
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
  JointOutcome outcome{std::move(input),
                       std::move(identified.pairs),
                       std::move(identified.directed),
                       *std::move(identified.joint),
                       std::move(*contributions),
                       std::move(*verdict),
                       std::move(document)};
  outcome.document.run->tables = joint_tables(outcome);
  for (const calib::otf::Observations& run : outcome.input.observations)
    outcome.document.run->places_m.push_back(run.vertices_m);
  return outcome;
}

}  // namespace

Result<std::variant<JointOutcome, JointContradiction>> identify_joint(
    const IdentifyJointArguments& arguments, const Progress& progress) {
  ABBE_TRY(
      require_word("--estimator", arguments.estimator.value_or(""), {"two-step", "simultaneous"}));
  auto input = read_joint_input(arguments, progress);
  ABBE_TRY(input);
  auto identified =
      joint::identify(input->parts, *input->common, {.false_alarm = arguments.false_alarm});
  if (!identified) return tl::make_unexpected(error_of(identified.error()));
  if (!identified->joint) return JointContradiction{*std::move(input), *std::move(identified)};
  auto outcome = judged(arguments, *std::move(input), *std::move(identified), progress);
  ABBE_TRY(outcome);
  return *std::move(outcome);
}

}  // namespace abbe::daemon
