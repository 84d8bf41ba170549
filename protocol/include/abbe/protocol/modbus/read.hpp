#pragma once
/// The one thing asked of Modbus here: read registers, functions 3 and 4 [Modbus Application
/// Protocol V1.1b3, 6.3, 6.4], over TCP (MBAP header) or RTU (CRC)
/// [Modbus over Serial Line V1.02, 2.5.1]. Sans-I/O, pure, allocation-free; usable on the real-time
/// path. The transaction number is always 0, as libmodbus sends it with a raw request: one request
/// is under way at a time, and a connection that missed an answer is closed.

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

inline constexpr std::size_t kMaxRegisters = 125;  ///< of one read
inline constexpr std::size_t kMaxAduSize = 260;    ///< TCP; RTU: 256
inline constexpr std::uint16_t kTcpPort = 502;

struct ReadRequest {
  std::uint8_t unit = 1;
  Function function = Function::ReadHoldingRegisters;
  std::uint16_t address = 0;  ///< as on the wire, from 0
  std::uint16_t count = 1;    ///< registers, 1 to kMaxRegisters
  friend bool operator==(const ReadRequest&, const ReadRequest&) = default;
};

enum class DecodeError : std::uint8_t {
  Length,         ///< impossible, or not that of the answer to this request
  Protocol,       ///< TCP: protocol number or transaction number is not 0
  Unit,           ///< another unit answers
  Function,       ///< another function, or one that is not known here
  Crc,            ///< RTU
  TrailingBytes,  ///< more than one answer
};
[[nodiscard]] std::string_view name_of(DecodeError error) noexcept;

/// The answer to a read: its registers as they came (big-endian pairs), or the code of an
/// exception.
struct Answer {
  std::span<const std::byte> registers;  ///< 2 * count bytes; empty with an exception
  std::optional<std::uint8_t> exception;
};
/// "illegal data address" and so on; "exception" for a code that the standard does not name.
[[nodiscard]] std::string_view name_of_exception(std::uint8_t code) noexcept;

/// Bytes written, 0 if `out` is too small. [Modbus V1.1b3] 6.3
std::size_t encode(const ReadRequest& request, Transport transport,
                   std::span<std::byte> out) ABBE_RT;
/// The request of a whole frame, as recorded or as a server receives it.
[[nodiscard]] tl::expected<ReadRequest, DecodeError> decode_request(
    std::span<const std::byte> frame, Transport transport) ABBE_RT;
/// Nothing: `bytes` are the beginning of a right answer, more must come. An error is said as soon
/// as it shows.
[[nodiscard]] std::optional<tl::expected<Answer, DecodeError>> decode_answer(
    std::span<const std::byte> bytes, Transport transport, const ReadRequest& request) ABBE_RT;
[[nodiscard]] std::uint16_t crc16(std::span<const std::byte> bytes) ABBE_RT;

}  // namespace abbe::protocol::modbus
