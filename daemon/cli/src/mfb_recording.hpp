#pragma once
/// The touches of a Multi-Feature Bar in recordings of the daemon.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/methods/mfb/acquisition.hpp"
#include "opened_recording.hpp"

namespace abbe::daemon {

/// The last run of the recording in which all touches were made. DataInsufficient without one; the
/// text gives the reason.
[[nodiscard]] Result<MfbRun> last_complete_bar_run(const OpenedRecording& recording);

/// The last calibration with a bar in the recording, complete or not: its request with all touches
/// that were taken until the end, to be continued. DataInsufficient without one.
[[nodiscard]] Result<MfbRequest> bar_request_to_continue(const OpenedRecording& recording);

}  // namespace abbe::daemon
