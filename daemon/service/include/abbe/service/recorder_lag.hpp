#pragma once
/// Warning that the recording is behind the machine. Pure; any thread.

#include <chrono>
#include <string>

namespace abbe::daemon {

/// From twice the period in which chunks are written; empty: none. The text does not change every
/// second.
[[nodiscard]] std::string text_of_lag(std::chrono::nanoseconds behind,
                                      std::chrono::nanoseconds chunk_period);

}  // namespace abbe::daemon
