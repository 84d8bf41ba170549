#pragma once
/// What the statuses of a controller mean to a session.

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "abbe/protocol/emscon/types.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

namespace emscon = protocol::emscon;

inline constexpr protocol::HostTime kNever = protocol::HostTime::max();

/// Waiting helps.
inline bool passes(emscon::Status s) {
  switch (s) {
    case emscon::Status::ServerBusy:
    case emscon::Status::InternalProcessActive:
    case emscon::Status::MeasurementNotReady:
    case emscon::Status::AdmStartUpBusy:
    case emscon::Status::SystemNotReady:
      return true;
    default:
      return false;
  }
}

/// A reflector in the beam helps.
inline bool needs_beam(emscon::Status s) {
  switch (s) {
    case emscon::Status::NoDistanceSet:
    case emscon::Status::MeasurementNotReady:
    case emscon::Status::SystemNotReady:
    case emscon::Status::WrongCurrentReflector:
      return true;
    default:
      return false;
  }
}

inline std::string refusal_text(emscon::Command command, emscon::Status status) {
  return fmt::format("{} was refused: {} ({})", emscon::name_of(command), emscon::name_of(status),
                     static_cast<std::int32_t>(status));
}

}  // namespace abbe::drivers
