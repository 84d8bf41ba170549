#pragma once
/// Constants for the first byte of SDO frames [CiA 301, SDO protocols]. Used by client and server.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "can/little_endian.hpp"

namespace abbe::protocol::can::sdo {

inline constexpr std::size_t kFrameBytes = 8;
inline constexpr std::size_t kExpeditedBytes = 4;
inline constexpr std::size_t kSegmentBytes = 7;

// Bits 7..5: command specifier. The meaning of a number depends on the direction.
inline constexpr std::uint8_t kSpecifierMask = 0xE0;
inline constexpr std::uint8_t kDownloadSegmentRequest = 0x00;
inline constexpr std::uint8_t kDownloadInitiateRequest = 0x20;
inline constexpr std::uint8_t kUploadInitiateRequest = 0x40;
inline constexpr std::uint8_t kUploadSegmentRequest = 0x60;
inline constexpr std::uint8_t kUploadSegmentAnswer = 0x00;
inline constexpr std::uint8_t kDownloadSegmentAnswer = 0x20;
inline constexpr std::uint8_t kUploadInitiateAnswer = 0x40;
inline constexpr std::uint8_t kDownloadInitiateAnswer = 0x60;
inline constexpr std::uint8_t kAbort = 0x80;

inline constexpr std::uint8_t kExpedited = 0x02;
inline constexpr std::uint8_t kSizeGiven = 0x01;
inline constexpr std::uint8_t kToggle = 0x10;
inline constexpr std::uint8_t kLastSegment = 0x01;

[[nodiscard]] inline std::uint8_t specifier(const CanFrame& f) noexcept {
  return f.byte(0) & kSpecifierMask;
}
[[nodiscard]] inline bool toggle(const CanFrame& f) noexcept {
  return (f.byte(0) & kToggle) != 0;
}
[[nodiscard]] inline ObjectId object_of(const CanFrame& f) noexcept {
  return {load_le<std::uint16_t>(f.data, 1), f.byte(3)};
}
[[nodiscard]] inline std::uint32_t code_name(const CanFrame& f) noexcept {
  return load_le<std::uint32_t>(f.data, 4);
}

/// A frame of eight bytes: command, object, 32-bit word.
[[nodiscard]] inline CanFrame frame(std::uint32_t cob_id, unsigned command, ObjectId object,
                                    std::uint32_t word = 0) noexcept {
  CanFrame f;
  f.id = cob_id;
  f.length = kFrameBytes;
  f.data[0] = static_cast<std::byte>(command);
  store_le(std::span{f.data}, 1, object.index);
  f.data[3] = std::byte{object.sub};
  store_le(std::span{f.data}, 4, word);
  return f;
}

/// Expedited initiate frame, which contains the data. The low four bits of the command (unused
/// bytes, expedited, size given) are the same in both directions.
[[nodiscard]] inline CanFrame expedited(std::uint32_t cob_id, unsigned command, ObjectId object,
                                        std::span<const std::byte> value) noexcept {
  const auto unused = static_cast<unsigned>(kExpeditedBytes - value.size());
  auto f = frame(cob_id, command | (unused << 2) | kExpedited | kSizeGiven, object);
  std::copy(value.begin(), value.end(), f.data.begin() + 4);
  return f;
}
/// Number of data bytes of an expedited initiate frame; 4 if the sender did not give the size.
[[nodiscard]] inline std::size_t expedited_size(const CanFrame& f) noexcept {
  return (f.byte(0) & kSizeGiven) != 0 ? kExpeditedBytes - ((f.byte(0) >> 2) & 3u)
                                       : kExpeditedBytes;
}

/// The next segment of a value; `rest` is the part of the value that was not sent yet. The low five
/// bits of the first byte (toggle, unused bytes, last segment) are the same in both directions.
[[nodiscard]] inline CanFrame segment(std::uint32_t cob_id, bool toggle_bit,
                                      std::span<const std::byte> rest) noexcept {
  const auto n = std::min(rest.size(), kSegmentBytes);
  const auto unused = static_cast<unsigned>(kSegmentBytes - n);
  CanFrame f;
  f.id = cob_id;
  f.length = kFrameBytes;
  f.data[0] = static_cast<std::byte>((toggle_bit ? kToggle : 0u) | (unused << 1) |
                                     (rest.size() <= kSegmentBytes ? kLastSegment : 0u));
  std::copy_n(rest.begin(), n, f.data.begin() + 1);
  return f;
}
[[nodiscard]] inline std::span<const std::byte> segment_data(const CanFrame& f) noexcept {
  return std::span{f.data}.subspan(1, kSegmentBytes - ((f.byte(0) >> 1) & 7u));
}
[[nodiscard]] inline bool is_last_segment(const CanFrame& f) noexcept {
  return (f.byte(0) & kLastSegment) != 0;
}

}  // namespace abbe::protocol::can::sdo
