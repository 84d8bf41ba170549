#pragma once
/// Progress and cancellation of an identification that runs on another thread. Pure data.

#include <functional>

namespace abbe::daemon {

/// Both functions are called on the thread of the identification and may be empty.
struct IdentificationWatch {
  std::function<void(double)> progress = {};  ///< 0 to 1
  std::function<bool()> stopped = {};         ///< true: the identification returns an Error soon
};

}  // namespace abbe::daemon
