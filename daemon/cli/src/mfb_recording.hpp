#pragma once
/// An interrupted calibration with a Multi-Feature Bar in a recording of the daemon.

#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/methods/mfb/acquisition.hpp"
#include "abbe/tasks/opened_recording.hpp"

namespace abbe::daemon {

/// The last calibration with a bar in the recording, complete or not: its request with all touches
/// that were taken until the end, to be continued. DataInsufficient without one.
[[nodiscard]] Result<MfbRequest> bar_request_to_continue(const OpenedRecording& recording);

}  // namespace abbe::daemon
