#pragma once
/// The instants of a recording in tests of its replay.
#include "abbe/protocol/time.hpp"

namespace abbe::sim {

using namespace std::chrono_literals;

inline constexpr protocol::HostTime kRecorded{5000s};  ///< start of the recording
inline constexpr protocol::HostTime kReplayed{90s};    ///< start of the replay

}  // namespace abbe::sim
