#include "abbe/tasks/identify_mfb.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/calib/mfb/run/touches_off.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/mfb/document.hpp"
#include "abbe/methods/mfb/inputs.hpp"
#include "abbe/methods/mfb/method.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tasks/accepted_reasons.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "abbe/tasks/scales_corrected.hpp"
#include "argument_checks.hpp"
#include "last_complete_run.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

struct MfbInput {
  Config config;
  MfbTask task;
  std::vector<InputFile> sources;
  /// lines of the touches in their file; empty for a recording
  std::vector<std::vector<std::size_t>> lines{};
  std::vector<std::string> against_pass{};
  ObservedTimes observed{};   ///< times of the recording; nullopt for files
  protocol::UtcOffset utc{};  ///< offset of the host clock of the recording
};

/// Reads the configuration of the machine, for the readings in the file `points`.
Result<Config> read_config(const IdentifyMfbArguments& arguments) {
  auto config = load_config(arguments.machine);
  if (!config) return config;
  ABBE_TRY(check_scales("identify mfb", "points", *config, arguments.scales_corrected));
  ABBE_TRY(check_bar_machine(arguments.machine, config->machine));
  return config;
}

mfb::Options options_of(const IdentifyMfbArguments& arguments) {
  mfb::Options options;
  options.solve.estimator =
      mfb::estimator_named(arguments.estimator).value_or(options.solve.estimator);
  return options;
}

/// Bar, plan and touches of a recorded session. No rows run against their pass, because the guide
/// of the session does not take such touches.
Result<MfbInput> input_of_recording(const IdentifyMfbArguments& arguments,
                                    const Progress& progress) {
  auto recording = open_recording(arguments.recording, arguments.machine,
                                  [&progress] { return progress.stopped(); });
  ABBE_TRY(recording);
  auto run = last_complete_run<MfbMethod>(*recording, arguments.recording, "calibration with a bar",
                                          progress);
  ABBE_TRY(run);

  MfbInput input{std::move(recording->config),
                 {.bar = {}, .plan = {}, .passes = {}, .options = options_of(arguments)},
                 {recording->source}};
  const auto entered = MfbMethod::inputs_of(*run);
  input.sources.insert(input.sources.end(), entered.begin(), entered.end());
  input.task.bar = std::move(run->bar);
  input.task.plan = std::move(run->plan);
  input.task.passes = std::move(run->passes);
  input.observed = run->observed;
  input.utc = recorded_clock(recording->reader).dates;
  return input;
}

Result<MfbInput> input_of_files(const IdentifyMfbArguments& arguments) {
  auto config = read_config(arguments);
  ABBE_TRY(config);
  const auto source = hashed_file(arguments.machine);
  ABBE_TRY(source);
  const auto machine = mfb_machine(config->machine);
  ABBE_TRY(machine);
  auto bar = read_bar_toml(arguments.bar);
  ABBE_TRY(bar);
  auto plan = read_bar_plan_toml(arguments.plan, bar->bar);
  ABBE_TRY(plan);
  auto points = read_bar_points_csv(arguments.points, bar->bar, *plan, machine->nodes);
  ABBE_TRY(points);

  MfbInput input{std::move(*config),
                 {.bar = std::move(bar->bar),
                  .plan = std::move(plan->plan),
                  .passes = std::move(points->passes),
                  .options = options_of(arguments)},
                 {*source, bar->source, plan->source, points->source}};
  input.lines = std::move(points->lines);
  input.against_pass = std::move(points->against_pass);
  return input;
}

Result<MfbInput> read_input(const IdentifyMfbArguments& arguments, const Progress& progress) {
  auto input = arguments.recording.empty() ? input_of_files(arguments)
                                           : input_of_recording(arguments, progress);
  if (!input) return input;
  if (arguments.trials > 0)
    input->task.monte_carlo = {.trials = arguments.trials, .seed = arguments.seed};
  return input;
}

/// One line for each single touch that does not fit the other touches of its measurement.
std::vector<std::string> lines_of_touches_off(const std::string& file, const MfbInput& input) {
  const auto& task = input.task;
  std::vector<std::string> lines;
  for (const auto& off : mfb::touches_off(task.bar, task.plan, task.passes)) {
    const auto& touch = task.passes[off.pass][off.touch];
    const std::string place =
        input.lines.empty() ? file : fmt::format("{}:{}", file, input.lines[off.pass][off.touch]);
    lines.push_back(fmt::format(
        "{}: {} of \"{}\" alone does not fit: {:.4g} mm off, the other touches fit the plan within "
        "{:.4g} mm rms: correct or repeat it",
        place, mfb::name(touch.target), task.plan.measurements[off.pass].name,
        kMmPerM * off.distance_m, kMmPerM * off.rms_others_m));
  }
  return lines;
}

/// Completes an error of the identification, which names measurement and feature: adds the name of
/// the file of touches at the front, and the possible causes at the end (single touches that do not
/// fit, rows against their pass).
Error in_points(const IdentifyMfbArguments& arguments, const MfbInput& input, Error error) {
  const std::string& file = arguments.recording.empty() ? arguments.points : arguments.recording;
  error.text = fmt::format("{}: {}", file, error.text);
  error.details = lines_of_touches_off(file, input);
  error.details.insert(error.details.end(), input.against_pass.begin(), input.against_pass.end());
  return error;
}

Result<MfbCandidate> identified(const IdentifyMfbArguments& arguments, const MfbInput& input,
                                const Progress& progress) {
  const auto active = active_model(arguments.keep);
  ABBE_TRY(active);
  const auto other = comparison_model(*active, input.config);
  auto candidate = identify_with_bar(
      input.task, input.config, other.model,
      [&progress](std::string_view step, double share) { progress.show(step, share); });
  if (!candidate) return tl::make_unexpected(in_points(arguments, input, candidate.error()));
  if (!input.against_pass.empty())
    return tl::make_unexpected(in_points(
        arguments, input, {ErrorCode::BadInput, "the drift of the passes would be wrong"}));
  other.add_note(candidate->verdict);
  return candidate;
}

Result<void> check(const IdentifyMfbArguments& arguments) {
  ABBE_TRY(require_word("--estimator", arguments.estimator, {"simultaneous", "sequential"}));
  if (!arguments.recording.empty())
    return require_none("--recording", {{"--points", !arguments.points.empty()},
                                        {"--bar", !arguments.bar.empty()},
                                        {"--plan", !arguments.plan.empty()},
                                        {"--scales-corrected", arguments.scales_corrected}});
  if (arguments.points.empty())
    return fail(ErrorCode::Usage,
                "identify mfb: give --points with --machine, --bar and --plan, or --recording");
  return require_all("identify mfb", {{"--machine", !arguments.machine.empty()},
                                      {"--bar", !arguments.bar.empty()},
                                      {"--plan", !arguments.plan.empty()}});
}

}  // namespace

Result<MfbOutcome> identify_mfb(const IdentifyMfbArguments& arguments, const Progress& progress) {
  ABBE_TRY(check(arguments));
  auto input = read_input(arguments, progress);
  ABBE_TRY(input);
  ABBE_TRY(accept_also(arguments.accept, input->config));
  auto candidate = identified(arguments, *input, progress);
  ABBE_TRY(candidate);

  auto document = mfb_document(*candidate, input->task.options.solve.estimator, input->config,
                               input->sources, utc_now());
  add_measured(document, input->observed, input->utc);
  return MfbOutcome{*std::move(candidate), std::move(document)};
}

}  // namespace abbe::daemon
