#include "abbe/protocol/can/sdo.hpp"

namespace abbe::protocol::can {

const char* to_text(AbortCode code) noexcept {
  switch (code) {
    case AbortCode::None:
      return "no error";
    case AbortCode::ToggleBit:
      return "toggle bit not alternated";
    case AbortCode::Timeout:
      return "SDO timed out";
    case AbortCode::BadCommand:
      return "command specifier not valid";
    case AbortCode::OutOfMemory:
      return "out of memory";
    case AbortCode::UnsupportedAccess:
      return "unsupported access";
    case AbortCode::WriteOnly:
      return "object is write-only";
    case AbortCode::ReadOnly:
      return "object is read-only";
    case AbortCode::NoObject:
      return "object does not exist";
    case AbortCode::NotMappable:
      return "object cannot be mapped";
    case AbortCode::PdoLength:
      return "mapped objects exceed the PDO";
    case AbortCode::ParameterIncompatible:
      return "parameter incompatible";
    case AbortCode::InternalIncompatible:
      return "internal incompatibility";
    case AbortCode::Hardware:
      return "hardware error";
    case AbortCode::LengthMismatch:
      return "data length does not match";
    case AbortCode::TooLong:
      return "data too long";
    case AbortCode::TooShort:
      return "data too short";
    case AbortCode::NoSubindex:
      return "sub-index does not exist";
    case AbortCode::InvalidValue:
      return "invalid value";
    case AbortCode::ValueTooHigh:
      return "value too high";
    case AbortCode::ValueTooLow:
      return "value too low";
    case AbortCode::MaximumBelowMinimum:
      return "maximum below minimum";
    case AbortCode::NoSdoConnection:
      return "no SDO connection";
    case AbortCode::General:
      return "general error";
    case AbortCode::CannotStore:
      return "data cannot be stored";
    case AbortCode::LocalControl:
      return "refused by local control";
    case AbortCode::DeviceState:
      return "refused in the present device state";
  }

  return "unknown abort code";
}

}  // namespace abbe::protocol::can
