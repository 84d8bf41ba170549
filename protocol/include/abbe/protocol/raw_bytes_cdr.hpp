#pragma once
/// The IDL type abbe::v1::RawBytes (idl/abbe_v1.idl) as XCDR1 plain CDR, little-endian, after the
/// four bytes 00 01 00 00 [OMG DDS-XTypes 1.3, 7.4.1; OMG DDSI-RTPS 2.5, 10.2]. Implemented without
/// a CDR library, so that a simulator can play back recorded bytes; a test compares the bytes with
/// those of Fast CDR. Layout (alignment counts from the end of the four bytes):
///   string device | align 8, int64 host_time_ns | uint32 lost_before | bool to_device
///   | bool continued | align 4, uint32 length | bytes
/// Any bytes give a value or an error. No allocation. Thread-safe.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include <tl/expected.hpp>

#include "abbe/protocol/samples.hpp"

namespace abbe::protocol {

/// One block of bytes as sent to or received from `device`. Views into the decoded bytes.
struct RawBytes {
  std::string_view device;  ///< at most 32 characters, no NUL
  HostTime time{};
  std::uint32_t lost_before = 0;
  RawBlock::Direction direction = RawBlock::Direction::FromDevice;
  bool continued = false;
  std::span<const std::byte> bytes;  ///< at most RawBlock::kCapacity
};

inline constexpr std::size_t kMaxDeviceNameLength = 32;
/// Sum of: encapsulation, device with its length and NUL, time, lost_before, flags, length, bytes;
/// padding included.
inline constexpr std::size_t kMaxRawBytesCdrSize = 4 + 40 + 8 + 4 + 4 + 4 + RawBlock::kCapacity;

enum class CdrError : std::uint8_t {
  Truncated,       ///< a field extends beyond the end
  NotCdrLe,        ///< the first four bytes are not those of plain CDR, little endian
  BadString,       ///< not terminated, or contains a NUL
  OutOfBounds,     ///< a string or sequence is longer than the IDL allows
  BadBool,         ///< neither 0 nor 1
  BufferTooSmall,  ///< encode only
};

/// Returns the number of bytes written to the front of `out`. kMaxRawBytesCdrSize bytes are always
/// sufficient.
[[nodiscard]] tl::expected<std::size_t, CdrError> encode_cdr(const RawBytes& value,
                                                             std::span<std::byte> out) noexcept;
/// Decodes a RawBytes. Bytes after the last field are ignored (CDR pads payloads to four bytes).
[[nodiscard]] tl::expected<RawBytes, CdrError> decode_raw_bytes_cdr(
    std::span<const std::byte> cdr) noexcept;

/// Converts a block of a raw ring to the recorded type; views into `block` and `device`.
[[nodiscard]] RawBytes to_raw_bytes(const RawBlock& block, std::string_view device) noexcept;
/// Copies the bytes into `block`, which does not contain the device's name. Precondition:
/// value.bytes fits, which decode_raw_bytes_cdr() guarantees; otherwise only the first
/// RawBlock::kCapacity bytes are copied.
void to_raw_block(const RawBytes& value, RawBlock& block) noexcept;

}  // namespace abbe::protocol
