#pragma once
/// Finds the last complete run of one method in a recording of the daemon.

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "abbe/methods/calibration_run.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/opened_recording.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// The last complete run of `Method`. DataInsufficient if there is none: "FILE: contains no
/// complete `what`: ", with the reason.
template <class Method>
[[nodiscard]] Result<typename Method::Run> last_complete_run(const OpenedRecording& recording,
                                                             std::string_view file,
                                                             std::string_view what,
                                                             const Progress& progress) {
  using Run = typename Method::Run;
  std::optional<Run> last;
  const auto replayed =
      replay(recording.reader, recording.config,
             {.progress = [&progress](double share) { progress.show("replaying", share); },
              .stopped = [&progress] { return progress.stopped(); },
              .runs =
                  [&last](CalibrationRun run) {
                    if (auto* of_method = std::get_if<Run>(&run)) last = std::move(*of_method);
                  }});
  ABBE_TRY(replayed);
  if (last) return *std::move(last);

  std::string why = replayed->calibrations.empty() ? "no calibration was requested"
                                                   : "its calibrations are of another method";
  for (const ReplayedCalibration& c : replayed->calibrations)
    if (c.ended.method == Method::kName) why = c.ended.reason;
  return fail(ErrorCode::DataInsufficient,
              fmt::format("{}: contains no complete {}: {}", file, what, why));
}

}  // namespace abbe::daemon
