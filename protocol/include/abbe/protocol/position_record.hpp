#pragma once
/// Axis positions of a control at one servo cycle, as one UDP datagram of 40 bytes, little-endian:
///
///   offset  type     is
///   0       uint32   magic, the bytes "ABBP"
///   4       uint16   version, 1
///   6 uint16 1: the axes are homed; 0: the positions have no meaning
///   8       uint32   number of the servo cycle; consecutive records have consecutive numbers
///   12      uint32   servo period, ns, 10 us to 100 ms
///   16      float64  scale readings of X, Y, Z, m
///
/// A control sends it to abbe-sim, whose machine then follows the control. Pure, allocation-free.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace abbe::protocol {

inline constexpr std::size_t kPositionRecordBytes = 40;

struct PositionRecord {
  bool homed = false;
  std::uint32_t cycle = 0;
  std::uint32_t period_ns = 0;
  std::array<double, 3> position_m{};
  friend bool operator==(const PositionRecord&, const PositionRecord&) = default;
};

[[nodiscard]] std::array<std::byte, kPositionRecordBytes> encode(const PositionRecord& record);
/// Decodes a datagram. nullopt: wrong size, magic or version, an invalid period, or a position that
/// is not finite.
[[nodiscard]] std::optional<PositionRecord> decode_position_record(
    std::span<const std::byte> datagram);

}  // namespace abbe::protocol
