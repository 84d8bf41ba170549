// Identifies a run that the daemon recorded: `abbe identify otf --recording ...`.
#include <fmt/format.h>

#include <utility>
#include <variant>

#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/method.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/accepted_reasons.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "abbe/tasks/opened_recording.hpp"
#include "last_complete_run.hpp"
#include "otf_run.hpp"

namespace abbe::daemon {
namespace {

struct RecordedCandidate {
  OtfCandidate candidate;
  ObservedTimes observed;
};

/// The last run of the recording in which the machine travelled the whole path.
Result<RecordedCandidate> last_complete_run(ReplayReport replayed, const std::string& file) {
  std::string why = replayed.calibrations.empty() ? "no calibration was requested" : "";
  for (auto c = replayed.calibrations.rbegin(); c != replayed.calibrations.rend(); ++c) {
    if (c->outcome && *c->outcome) {
      if (auto* otf = std::get_if<OtfCandidate>(&**c->outcome))
        return RecordedCandidate{std::move(*otf), c->observed};
      continue;
    }
    if (why.empty()) why = c->outcome ? c->outcome->error().text : c->ended.reason;
  }
  return fail(ErrorCode::DataInsufficient,
              fmt::format("{}: contains no complete calibration: {}", file, why));
}

/// The configuration for the identification of a recorded run.
Result<Config> config_for(const IdentifyOtfArguments& arguments, const Config& recorded) {
  auto config = load_config(arguments.machine);
  if (!config) return config;
  if (config->machine.chain != recorded.machine.chain)
    return fail(ErrorCode::BadInput,
                fmt::format("{}: was recorded on a machine with the chain {}, {} has {}",
                            arguments.recording, recorded.machine.chain, arguments.machine,
                            config->machine.chain));
  take_recorded_readings(*config, &recorded);
  if (recorded.machine.target_given) set_target_offset(*config, recorded.machine.target_offset_m);
  if (recorded.machine.tracker_position_m)
    config->machine.tracker_position_m = recorded.machine.tracker_position_m;
  apply(arguments, *config);
  ABBE_TRY(require_target(config->machine));
  return config;
}

}  // namespace

Result<OtfFromFiles> identify_recorded(const IdentifyOtfArguments& arguments,
                                       const Progress& progress) {
  const auto recording = open_recording(arguments.recording);
  ABBE_TRY(recording);
  auto config = config_for(arguments, recording->config);
  ABBE_TRY(config);
  auto run =
      last_complete_run<OtfMethod>(*recording, arguments.recording, "run along a path", progress);
  ABBE_TRY(run);
  if (arguments.u_scale_ppm) run->u_scale = u_scale_of(arguments, *config);

  const IdentificationWatch watch{
      .progress = [&progress](double share) { progress.show("identifying", share); }};
  auto identified = identify_otf(otf_task(*run, *config, watch), *config, nullptr);
  ABBE_TRY(identified);
  judge_recording(recording->reader, identified->verdict);
  return OtfFromFiles{*std::move(config),
                      {recording->source},
                      identified->noise,
                      run->mode,
                      std::move(identified->found),
                      std::move(identified->verdict),
                      std::move(identified->residuals)};
}

Result<OtfOutcome> from_recording(const IdentifyOtfArguments& arguments,
                                  const std::optional<ActiveDocument>& active,
                                  const Progress& progress) {
  const auto stopped = [&progress] { return progress.stopped(); };
  auto recording = open_recording(arguments.recording, arguments.machine, stopped);
  ABBE_TRY(recording);
  ABBE_TRY(accept_also(arguments.accept, recording->config));
  apply(arguments, recording->config);
  ABBE_TRY(apply_smoothness(arguments.smoothness, recording->config));
  ABBE_TRY(require_target(recording->config.machine));
  const auto other = comparison_model(active, recording->config);
  auto replayed =
      replay(recording->reader, recording->config,
             {.active = other.model,
              .progress = [&progress](double share) { progress.show("replaying", share); },
              .stopped = stopped});
  ABBE_TRY(replayed);
  auto recorded = last_complete_run(std::move(*replayed), arguments.recording);
  ABBE_TRY(recorded);
  other.add_note(recorded->candidate.verdict);
  auto outcome = outcome_of(std::move(recorded->candidate), recording->config, {recording->source});
  add_measured(outcome.document, recorded->observed, recorded_clock(recording->reader).dates);
  outcome.document.recording_gap = recording->reader.damage();

  return outcome;
}

}  // namespace abbe::daemon
