#pragma once
/// The kinds of devices, each with the source file that defines it.

#include "abbe/devices/device_kind.hpp"

namespace abbe::daemon {

extern const DeviceKind kTracker;           // tracker.cpp
extern const DeviceKind kEncoder;           // encoder.cpp
extern const DeviceKind kCounterCard;       // counter_card.cpp
extern const DeviceKind kReferenceCard;     // reference_card.cpp
extern const DeviceKind kEnvironment;       // environment.cpp
extern const DeviceKind kMeasuringMachine;  // measuring_machine.cpp

}  // namespace abbe::daemon
