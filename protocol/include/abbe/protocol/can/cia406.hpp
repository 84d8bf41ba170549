#pragma once
/// Objects of an encoder by name: communication profile [CiA 301] and encoder profile [CiA 406].
/// Constants only.

#include <cstdint>

#include "abbe/protocol/can/sdo.hpp"

namespace abbe::protocol::can::object {

/// u32: low word profile, high word kind of encoder
inline constexpr ObjectId kDeviceType{0x1000, 0};
inline constexpr ObjectId kErrorRegister{0x1001, 0};  ///< u8
inline constexpr ObjectId kErrorHistory{0x1003, 0};   ///< :00 count, :01.. newest first
inline constexpr ObjectId kSyncCobId{0x1005, 0};      ///< u32
inline constexpr ObjectId kDeviceName{0x1008, 0};     ///< text
inline constexpr ObjectId kHeartbeatTime{0x1017, 0};  ///< u16 ms, 0 = off
inline constexpr ObjectId kVendor{0x1018, 1};
inline constexpr ObjectId kProduct{0x1018, 2};
inline constexpr ObjectId kRevision{0x1018, 3};
inline constexpr ObjectId kSerial{0x1018, 4};
inline constexpr std::uint16_t kSdoServer = 0x1200;
/// Communication parameters of a TPDO, index 1800h + TPDO number - 1; sub-indices: :01 COB-ID, :02
/// transmission type, :03 inhibit time, :05 event timer.
inline constexpr std::uint16_t kTpdoParameters = 0x1800;
inline constexpr std::uint16_t kTpdoMapping = 0x1A00;  ///< + TPDO number - 1

inline constexpr ObjectId kOperatingParameters{0x6000, 0};  ///< u16
/// Bit of 6000h of rotary encoders. Set: 6001h and 6002h determine resolution and range; not set:
/// 6501h and 6502h do.
inline constexpr std::uint16_t kScalingOn = 0x0004;
inline constexpr ObjectId kUnitsPerRevolution{0x6001, 0};  ///< u32, rotary
inline constexpr ObjectId kTotalRange{0x6002, 0};          ///< u32, measuring units
inline constexpr ObjectId kPreset{0x6003, 0};        ///< i32: writing sets the present position
inline constexpr ObjectId kPosition{0x6004, 0};      ///< i32 (linear) or u32 (rotary), PDO-mappable
inline constexpr ObjectId kPositionStep{0x6005, 1};  ///< u32, nm per count (0.001 um)
inline constexpr ObjectId kPosition64{0x6008, 0};    ///< 64 bit, PDO-mappable
inline constexpr ObjectId kPreset64{0x6009, 0};
inline constexpr ObjectId kMultiPosition{0x6020, 1};  ///< i32, sensor 1 of a multi-sensor device
inline constexpr ObjectId kCyclicTimer{0x6200, 0};    ///< u16 ms, alias of 1800h:05
inline constexpr ObjectId kOperatingStatus{0x6500, 0};
inline constexpr ObjectId kMeasuringStep{0x6501, 0};  ///< u32, nm per count, read-only
/// u16, rotary: number of distinguishable revolutions
inline constexpr ObjectId kRevolutions{0x6502, 0};
inline constexpr ObjectId kAlarms{0x6503, 0};  ///< u16, bit 0: position error
inline constexpr ObjectId kSupportedAlarms{0x6504, 0};
inline constexpr ObjectId kWarnings{0x6505, 0};
inline constexpr ObjectId kSupportedWarnings{0x6506, 0};
inline constexpr ObjectId kProfileVersion{0x6507, 0};
inline constexpr ObjectId kOffset{0x6509, 0};  ///< i32, position - raw position, from the preset

inline constexpr std::uint32_t kPdoDisabled = 0x80000000;  ///< bit 31 of 1800h:01
inline constexpr std::uint32_t kPdoNoRemote = 0x40000000;  ///< bit 30 of 1800h:01

inline constexpr std::uint16_t kEncoderProfile = 0x0196;  ///< low word of 1000h: 406
/// High word of 1000h, as used by products.
enum class EncoderKind : std::uint16_t {
  SingleTurn = 1,
  MultiTurn = 2,
  AbsoluteLinear = 8,
  MultiSensorLinear = 10,
};
[[nodiscard]] constexpr bool is_encoder(std::uint32_t device_type) noexcept {
  return (device_type & 0xFFFF) == kEncoderProfile;
}
[[nodiscard]] constexpr bool is_linear(std::uint32_t device_type) noexcept {
  const auto kind = static_cast<EncoderKind>(device_type >> 16);
  return kind == EncoderKind::AbsoluteLinear || kind == EncoderKind::MultiSensorLinear;
}
[[nodiscard]] constexpr std::uint32_t device_type_of(EncoderKind kind) noexcept {
  return (std::uint32_t{static_cast<std::uint16_t>(kind)} << 16) | kEncoderProfile;
}

}  // namespace abbe::protocol::can::object
