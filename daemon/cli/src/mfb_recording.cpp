#include "mfb_recording.hpp"

#include <fmt/format.h>

#include <optional>
#include <utility>
#include <variant>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/mfb/method.hpp"
#include "abbe/replay/replay.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

/// The last request of the recording for a calibration with a bar.
Result<CalibrationRequest> last_bar_request(const OpenedRecording& recording) {
  std::optional<CalibrationRequest> last;
  for (const RecordingAttachment& attachment : recording.reader.attachments()) {
    if (!attachment.name.starts_with(kRequestNamePrefix)) continue;
    auto request = from_attachment(attachment);
    if (!request) return request;
    if (std::holds_alternative<MfbRequest>(request->task)) last = std::move(*request);
  }
  if (last) return std::move(*last);
  return fail(ErrorCode::DataInsufficient,
              fmt::format("{}: contains no calibration with a bar", recording.source.name));
}

}  // namespace

Result<MfbRequest> bar_request_to_continue(const OpenedRecording& recording) {
  auto request = last_bar_request(recording);
  if (!request) return tl::make_unexpected(request.error());
  auto& asked = std::get<MfbRequest>(request->task);
  auto acquisition = MfbAcquisition::create(asked, MfbMethod::options(recording.config));
  if (!acquisition) return tl::make_unexpected(acquisition.error());
  acquisition->begin(request->from);

  ProgressBar bar;
  const auto replayed =
      replay(recording.reader, recording.config,
             {.progress = [&bar](double share) { bar.show("replaying", share); },
              .snapshots = [&acquisition](const protocol::Snapshot& s) { acquisition->take(s); },
              .runs = [](const CalibrationRun&) {}});
  if (!replayed) return tl::make_unexpected(replayed.error());
  asked.earlier_m = acquisition->readings_m();
  return std::move(asked);
}

}  // namespace abbe::daemon
