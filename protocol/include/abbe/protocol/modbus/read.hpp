#pragma once
/// Reading registers by Modbus, functions 3 and 4 [Modbus Application Protocol V1.1b3, 6.3, 6.4],
/// over TCP (MBAP header) or RTU (CRC) [Modbus over Serial Line V1.02, 2.5.1]. Sans-I/O, pure,
/// allocation-free; usable on the real-time path. The transaction number is always 0, as libmodbus
/// sends it with a raw request. Only one request is outstanding at a time.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::modbus {

enum class Transport : std::uint8_t { Tcp, Rtu };

enum class Function : std::uint8_t { ReadHoldingRegisters = 3, ReadInputRegisters = 4 };

inline constexpr std::size_t kMaxRegisters = 125;  ///< most registers in one read
inline constexpr std::size_t kMaxAduSize = 260;    ///< TCP; RTU: 256
inline constexpr std::uint16_t kTcpPort = 502;

struct ReadRequest {
  std::uint8_t unit = 1;
  Function function = Function::ReadHoldingRegisters;
  std::uint16_t address = 0;  ///< address on the wire, counted from 0
  std::uint16_t count = 1;    ///< registers, 1 to kMaxRegisters
  friend bool operator==(const ReadRequest&, const ReadRequest&) = default;
};

enum class DecodeError : std::uint8_t {
  Length,         ///< invalid, or not the length of the answer to this request
  Protocol,       ///< TCP: protocol number or transaction number is not 0
  Unit,           ///< the answer is from another unit
  Function,       ///< another function than requested, or an unsupported one
  Crc,            ///< RTU
  TrailingBytes,  ///< the frame contains more than one answer
};
[[nodiscard]] std::string_view name_of(DecodeError error) noexcept;

/// The answer to a read: its registers as received (big-endian), or the code of an exception.
struct Answer {
  std::span<const std::byte> registers;  ///< 2 * count bytes; empty with an exception
  std::optional<std::uint8_t> exception;
};
/// Text of an exception code, such as "illegal data address"; "exception" for a code that is not in
/// the standard.
[[nodiscard]] std::string_view name_of_exception(std::uint8_t code) noexcept;

/// Writes the request to `out`. Returns the number of bytes, 0 if `out` is too small. [Modbus
/// V1.1b3] 6.3
std::size_t encode(const ReadRequest& request, Transport transport,
                   std::span<std::byte> out) ABBE_RT;
/// Decodes a complete request frame, as recorded or as received by a server.
[[nodiscard]] tl::expected<ReadRequest, DecodeError> decode_request(
    std::span<const std::byte> frame, Transport transport) ABBE_RT;
/// Decodes the answer to `request`. nullopt: `bytes` are the beginning of a valid answer, and more
/// bytes are needed. An error is returned as soon as it is detected.
[[nodiscard]] std::optional<tl::expected<Answer, DecodeError>> decode_answer(
    std::span<const std::byte> bytes, Transport transport, const ReadRequest& request) ABBE_RT;
[[nodiscard]] std::uint16_t crc16(std::span<const std::byte> bytes) ABBE_RT;

}  // namespace abbe::protocol::modbus
