// `abbe identify otf --recording ...`: a run that the daemon recorded.
#include <fmt/format.h>

#include <utility>
#include <variant>

#include "abbe/config/calibration_machine.hpp"
#include "abbe/replay/replay.hpp"
#include "identified_model.hpp"
#include "identify_otf.hpp"
#include "opened_recording.hpp"

namespace abbe::daemon {
namespace {

/// The last run of the recording in which the whole path was driven.
Result<OtfCandidate> last_complete_run(ReplayReport replayed, const std::string& file) {
  std::string why = replayed.calibrations.empty() ? "no calibration was requested" : "";
  for (auto c = replayed.calibrations.rbegin(); c != replayed.calibrations.rend(); ++c) {
    if (c->outcome && *c->outcome) {
      if (auto* otf = std::get_if<OtfCandidate>(&**c->outcome)) return std::move(*otf);
      continue;
    }
    if (why.empty()) why = c->outcome ? c->outcome->error().text : c->ended.reason;
  }
  return fail(ErrorCode::DataInsufficient,
              fmt::format("{}: contains no complete calibration: {}", file, why));
}

}  // namespace

Result<OtfOutcome> from_recording(const IdentifyOtfArguments& arguments,
                                  const std::optional<ModelDocument>& active, ProgressBar& bar) {
  auto recording = open_recording(arguments.recording, arguments.machine);
  if (!recording) return tl::make_unexpected(recording.error());
  apply(arguments, recording->config);
  if (const auto given = require_target(recording->config.machine); !given)
    return tl::make_unexpected(given.error());
  const auto other = comparison_model(active, recording->config);
  auto replayed = replay(
      recording->reader, recording->config,
      {.active = other.model, .progress = [&bar](double share) { bar.show("replaying", share); }});
  if (!replayed) return tl::make_unexpected(replayed.error());
  auto candidate = last_complete_run(std::move(*replayed), arguments.recording);
  if (!candidate) return tl::make_unexpected(candidate.error());
  other.add_note(candidate->verdict);
  auto outcome = outcome_of(std::move(*candidate), recording->config, {recording->source});
  outcome.document.recording_gap = recording->reader.damage();

  return outcome;
}

}  // namespace abbe::daemon
