#pragma once
/// Classification of the statuses with which a controller refuses a command.

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "abbe/protocol/emscon/types.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

namespace emscon = protocol::emscon;

/// True for a temporary status: the command is repeated later.
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

/// True for a status that ends when a reflector is in the beam.
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
