#pragma once
/// Warning that the recording is behind the machine. Pure; any thread.

#include <chrono>
#include <string>

namespace abbe::daemon {

/// The warning if `behind` is at least twice the period in which chunks are written; else empty.
/// The text does not change every second.
[[nodiscard]] std::string text_of_lag(std::chrono::nanoseconds behind,
                                      std::chrono::nanoseconds chunk_period);

}  // namespace abbe::daemon
