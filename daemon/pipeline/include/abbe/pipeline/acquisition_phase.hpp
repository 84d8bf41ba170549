#pragma once
/// How far the acquisition of a run is, whatever the method.

#include <cstdint>

namespace abbe::daemon {

enum class AcquisitionPhase : std::uint8_t { WaitingAtStart, Running, Complete, Failed };

}  // namespace abbe::daemon
