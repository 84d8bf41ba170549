#pragma once
/// Common definitions of SDO client and server: object address, abort codes, size limit [CiA 301].
/// Pure data.

#include <compare>
#include <cstddef>
#include <cstdint>

namespace abbe::protocol::can {

/// Index and sub-index of an object.
struct ObjectId {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  friend constexpr auto operator<=>(const ObjectId&, const ObjectId&) = default;
};

/// Size limit of an object's value, bytes; a longer value is refused with OutOfMemory. Values of
/// encoders are numbers and names.
inline constexpr std::size_t kMaxSdoBytes = 128;

enum class AbortCode : std::uint32_t {
  None = 0,
  ToggleBit = 0x05030000,
  Timeout = 0x05040000,
  BadCommand = 0x05040001,
  OutOfMemory = 0x05040005,
  UnsupportedAccess = 0x06010000,
  WriteOnly = 0x06010001,
  ReadOnly = 0x06010002,
  NoObject = 0x06020000,
  NotMappable = 0x06040041,
  PdoLength = 0x06040042,
  ParameterIncompatible = 0x06040043,
  InternalIncompatible = 0x06040047,
  Hardware = 0x06060000,
  LengthMismatch = 0x06070010,
  TooLong = 0x06070012,
  TooShort = 0x06070013,
  NoSubindex = 0x06090011,
  InvalidValue = 0x06090030,
  ValueTooHigh = 0x06090031,
  ValueTooLow = 0x06090032,
  MaximumBelowMinimum = 0x06090036,
  NoSdoConnection = 0x060A0023,
  General = 0x08000000,
  CannotStore = 0x08000020,
  LocalControl = 0x08000021,
  DeviceState = 0x08000022,
};
/// True if the abort is caused by the object itself, so that a retry gives the same result. False
/// for temporary states of the node (booting, storing, a hardware fault).
[[nodiscard]] constexpr bool is_lasting(AbortCode code) noexcept {
  const auto value = static_cast<std::uint32_t>(code);
  return value >> 24 == 0x06 && code != AbortCode::Hardware;
}
/// A short English name, "unknown abort code" for others. Static storage.
[[nodiscard]] const char* to_text(AbortCode code) noexcept;

}  // namespace abbe::protocol::can
