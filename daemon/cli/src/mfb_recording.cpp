#include "mfb_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/mfb/method.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/result/try.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

/// The last request in the recording for a calibration with a bar.
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

/// The touches of a session, and the time at which the live session ended.
struct RecordedTouches {
  std::vector<protocol::Snapshot> touches;
  protocol::HostTime end = protocol::HostTime::max();
};

Result<RecordedTouches> touches_after(protocol::HostTime from, const OpenedRecording& recording) {
  RecordedTouches found;
  const auto take_event = [&](const v1::CalibrationEvent& event) {
    const protocol::HostTime time{std::chrono::nanoseconds{event.host_time_ns()}};
    const bool ends = event.state() == name(SessionState::Refused) ||
                      event.state() == name(SessionState::Identifying);
    if (time >= from && event.method() == MfbMethod::kName && ends)
      found.end = std::min(found.end, time);
  };

  ProgressBar bar;
  const auto replayed = replay(recording.reader, recording.config,
                               {.progress = [&bar](double share) { bar.show("replaying", share); },
                                .snapshots =
                                    [&found](const protocol::Snapshot& s) {
                                      if (s.has_trigger) found.touches.push_back(s);
                                    },
                                .events = take_event,
                                .runs = [](const CalibrationRun&) {}});
  ABBE_TRY(replayed);
  return found;
}

}  // namespace

Result<MfbRequest> bar_request_to_continue(const OpenedRecording& recording) {
  auto request = last_bar_request(recording);
  ABBE_TRY(request);
  auto& asked = std::get<MfbRequest>(request->task);
  auto acquisition = MfbAcquisition::create(asked, MfbMethod::options(recording.config));
  ABBE_TRY(acquisition);
  const auto recorded = touches_after(request->from, recording);
  ABBE_TRY(recorded);

  acquisition->begin(request->from);
  for (const protocol::Snapshot& touch : recorded->touches)
    if (touch.head.time <= recorded->end) acquisition->take(touch);
  asked.earlier_m = acquisition->readings_m();
  return std::move(asked);
}

}  // namespace abbe::daemon
