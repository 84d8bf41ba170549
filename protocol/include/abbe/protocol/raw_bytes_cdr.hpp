#pragma once
/// The IDL type abbe::v1::RawBytes (idl/abbe_v1.idl) as XCDR1 plain CDR, little endian, behind the
/// four bytes 00 01 00 00 [OMG DDS-XTypes 1.3, 7.4.1; OMG DDSI-RTPS 2.5, 10.2]. By hand, so that a
/// simulator can play recorded bytes back without a CDR library; tested to be the same bytes Fast
/// CDR writes.
///   string device | align 8, int64 host_time_ns | uint32 lost_before | bool to_device | bool continued
///   | align 4, uint32 length | bytes                                    (alignment counts from behind the
///   four bytes)
/// Total: any bytes give a value or an error. No allocation. Thread-safe.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include <tl/expected.hpp>

#include "abbe/protocol/samples.hpp"

namespace abbe::protocol {

/// One block of bytes as it crossed the boundary of `device`. Views into what it was decoded from.
struct RawBytes {
  std::string_view device;  ///< at most 32 characters, no NUL
  HostTime time{};
  std::uint32_t lost_before = 0;
  RawBlock::Direction direction = RawBlock::Direction::FromDevice;
  bool continued = false;
  std::span<const std::byte> bytes;  ///< at most RawBlock::kCapacity
};

inline constexpr std::size_t kMaxDeviceNameLength = 32;
/// Encapsulation, device with its length and NUL, time, lost_before, flags, length, bytes; paddings
/// included.
inline constexpr std::size_t kMaxRawBytesCdrSize = 4 + 40 + 8 + 4 + 4 + 4 + RawBlock::kCapacity;

enum class CdrError : std::uint8_t {
  Truncated,       ///< a field passes the end
  NotCdrLe,        ///< the first four bytes are not those of plain CDR, little endian
  BadString,       ///< not terminated, or with a NUL inside
  OutOfBounds,     ///< a string or sequence is longer than the IDL allows
  BadBool,         ///< neither 0 nor 1
  BufferTooSmall,  ///< encode only
};

/// Size written to the front of `out`. Of `out`, kMaxRawBytesCdrSize bytes are always enough.
[[nodiscard]] tl::expected<std::size_t, CdrError> encode_cdr(const RawBytes& value,
                                                             std::span<std::byte> out) noexcept;
/// Bytes behind the last field are not looked at (CDR pads payloads to four).
[[nodiscard]] tl::expected<RawBytes, CdrError> decode_raw_bytes_cdr(
    std::span<const std::byte> cdr) noexcept;

/// A block of a raw ring as the recordable value; views into `block` and `device`.
[[nodiscard]] RawBytes to_raw_bytes(const RawBlock& block, std::string_view device) noexcept;
/// Copies the bytes into `block` (the device's name has no place in it). Precondition: value.bytes
/// fits, which decode_raw_bytes_cdr() guarantees; of longer ones only the first RawBlock::kCapacity
/// are kept.
void to_raw_block(const RawBytes& value, RawBlock& block) noexcept;

}  // namespace abbe::protocol
