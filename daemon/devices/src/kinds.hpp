#pragma once
/// The kinds of devices that abbed runs, each defined in one source file.

#include <array>

#include "abbe/devices/device_kind.hpp"

namespace abbe::daemon {

extern const DeviceKind kTracker;           // tracker.cpp
extern const DeviceKind kEncoder;           // encoder.cpp
extern const DeviceKind kCounterCard;       // counter_card.cpp
extern const DeviceKind kAxisLines;         // axis_lines.cpp
extern const DeviceKind kReferenceCard;     // reference_card.cpp
extern const DeviceKind kEnvironment;       // environment.cpp
extern const DeviceKind kMeasuringMachine;  // measuring_machine.cpp

/// All kinds, in the order of the health report.
[[nodiscard]] inline auto all_kinds() {
  return std::array{kTracker,       kEncoder,     kCounterCard,     kAxisLines,
                    kReferenceCard, kEnvironment, kMeasuringMachine};
}

}  // namespace abbe::daemon
