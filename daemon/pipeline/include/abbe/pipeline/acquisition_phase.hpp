#pragma once
/// Phase of the acquisition of a run, for any method.

#include <cstdint>

namespace abbe::daemon {

enum class AcquisitionPhase : std::uint8_t { WaitingAtStart, Running, Complete, Failed };

}  // namespace abbe::daemon
