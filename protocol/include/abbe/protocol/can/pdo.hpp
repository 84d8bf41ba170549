#pragma once
/// Process data: mapping entries [CiA 301, object 1A00h] and the position in a TPDO
/// [CiA 406, objects 6004h, 6008h]. Pure, no allocation, accepts any bytes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::can {

/// One mapping entry: an object and its number of bits. Value in 1A00h:
///   index << 16 | sub << 8 | bits
struct MappedObject {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t bits = 0;
  friend bool operator==(const MappedObject&, const MappedObject&) = default;
};
[[nodiscard]] constexpr std::uint32_t encode_mapping(MappedObject m) noexcept {
  return (std::uint32_t{m.index} << 16) | (std::uint32_t{m.sub} << 8) | m.bits;
}
[[nodiscard]] constexpr MappedObject decode_mapping(std::uint32_t entry) noexcept {
  return {static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8),
          static_cast<std::uint8_t>(entry)};
}

/// Data type of the position of an encoder.
enum class PositionType : std::uint8_t {
  Signed32,    ///< 6004h of linear encoders
  Unsigned32,  ///< 6004h of rotary encoders
  /// 6008h. CiA 406 v3.1 does not define whether it is signed; it is decoded as signed, because a
  /// scale with negative positions needs a sign.
  Signed64,
};
[[nodiscard]] constexpr std::size_t size_of(PositionType type) noexcept {
  return type == PositionType::Signed64 ? 8 : 4;
}
/// The mapping entry of a position: 6004h:00, 32 bits, or 6008h:00, 64 bits.
[[nodiscard]] constexpr MappedObject mapped_position(PositionType type) noexcept {
  return type == PositionType::Signed64 ? MappedObject{0x6008, 0, 64} : MappedObject{0x6004, 0, 32};
}

/// The position in device counts at byte `offset` of the payload of a TPDO; nullopt if the payload
/// is too short.
[[nodiscard]] std::optional<std::int64_t> decode_position(std::span<const std::byte> payload,
                                                          PositionType type,
                                                          std::size_t offset = 0) ABBE_RT;
/// A TPDO that contains only a position. Counts that do not fit into 32 bits wrap, as in a device's
/// counter.
[[nodiscard]] CanFrame encode_position(std::uint32_t cob_id, PositionType type,
                                       std::int64_t count) ABBE_RT;

}  // namespace abbe::protocol::can
