#include "abbe/protocol/modbus/read.hpp"

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::modbus {
namespace {

using Outcome = std::optional<tl::expected<Answer, DecodeError>>;

// MBAP header up to the unit: transaction, protocol, length. The field `length` counts the unit,
// too.
constexpr std::size_t kMbapSize = 6;
constexpr std::size_t kCrcSize = 2;
constexpr std::size_t kRequestSize = 6;     // unit, function, address, count
constexpr std::size_t kAnswerHeadSize = 3;  // unit, function, byte count
constexpr std::size_t kExceptionSize = 3;   // unit, function | 80h, code
constexpr std::uint8_t kExceptionBit = 0x80;

Outcome fail(DecodeError error) ABBE_RT {
  return Outcome{tl::make_unexpected(error)};
}

bool known(std::uint8_t function) ABBE_RT {
  return function == 3 || function == 4;
}

std::uint8_t u8(std::byte b) ABBE_RT {
  return std::to_integer<std::uint8_t>(b);
}

bool crc_agrees(std::span<const std::byte> frame) ABBE_RT {
  const auto body = frame.first(frame.size() - kCrcSize);
  return ByteReader{frame.last(kCrcSize)}.little<std::uint16_t>() == crc16(body);
}

/// Decodes the part of an answer that is the same over TCP and RTU: unit, function and data.
/// nullopt: more bytes are needed.
Outcome decode_body(std::span<const std::byte> body, const ReadRequest& request) ABBE_RT {
  if (!body.empty() && u8(body[0]) != request.unit) return fail(DecodeError::Unit);
  if (body.size() < 2) return std::nullopt;
  const auto function = static_cast<std::uint8_t>(request.function);
  if ((u8(body[1]) & ~kExceptionBit) != function) return fail(DecodeError::Function);
  if (body.size() < kAnswerHeadSize) return std::nullopt;
  if ((u8(body[1]) & kExceptionBit) != 0) return Outcome{Answer{{}, u8(body[2])}};
  const std::size_t bytes = std::size_t{2} * request.count;
  if (u8(body[2]) != bytes) return fail(DecodeError::Length);
  if (body.size() < kAnswerHeadSize + bytes) return std::nullopt;
  return Outcome{Answer{body.subspan(kAnswerHeadSize, bytes), std::nullopt}};
}

std::size_t body_size(const Answer& answer) ABBE_RT {
  return answer.exception ? kExceptionSize : kAnswerHeadSize + answer.registers.size();
}

Outcome decode_tcp(std::span<const std::byte> bytes, const ReadRequest& request) ABBE_RT {
  for (std::size_t i = 0; i < std::min<std::size_t>(4, bytes.size()); ++i) {
    if (bytes[i] != std::byte{0}) return fail(DecodeError::Protocol);
  }
  if (bytes.size() < kMbapSize) return std::nullopt;
  const std::size_t length = ByteReader{bytes.subspan(4)}.big<std::uint16_t>();
  const std::size_t whole = kAnswerHeadSize + std::size_t{2} * request.count;
  if (length != whole && length != kExceptionSize) return fail(DecodeError::Length);
  const auto answer = decode_body(bytes.subspan(kMbapSize), request);
  if (!answer || !*answer) return answer;
  if (length != body_size(**answer)) return fail(DecodeError::Length);
  if (bytes.size() > kMbapSize + length) return fail(DecodeError::TrailingBytes);
  return answer;
}

Outcome decode_rtu(std::span<const std::byte> bytes, const ReadRequest& request) ABBE_RT {
  const auto answer = decode_body(bytes, request);
  if (!answer || !*answer) return answer;
  const std::size_t whole = body_size(**answer) + kCrcSize;
  if (bytes.size() < whole) return std::nullopt;
  if (!crc_agrees(bytes.first(whole))) return fail(DecodeError::Crc);
  if (bytes.size() > whole) return fail(DecodeError::TrailingBytes);
  return answer;
}

}  // namespace

/// Polynomial A001h, initial value FFFFh [Modbus over Serial Line V1.02, 6.2.2].
std::uint16_t crc16(std::span<const std::byte> bytes) ABBE_RT {
  std::uint16_t crc = 0xFFFF;
  for (const std::byte b : bytes) {
    crc = static_cast<std::uint16_t>(crc ^ u8(b));
    for (int bit = 0; bit < 8; ++bit) {
      crc = static_cast<std::uint16_t>((crc & 1u) != 0 ? (crc >> 1) ^ 0xA001u : crc >> 1);
    }
  }
  return crc;
}

std::size_t encode(const ReadRequest& request, Transport transport,
                   std::span<std::byte> out) ABBE_RT {
  ByteWriter writer{out};
  if (transport == Transport::Tcp) {
    writer.zeros(4);
    writer.big(static_cast<std::uint16_t>(kRequestSize));
  }
  writer.big(request.unit);
  writer.big(static_cast<std::uint8_t>(request.function));
  writer.big(request.address);
  writer.big(request.count);
  if (transport == Transport::Rtu) writer.little(crc16(writer.written()));
  return writer.ok() ? writer.size() : 0;
}

tl::expected<ReadRequest, DecodeError> decode_request(std::span<const std::byte> frame,
                                                      Transport transport) ABBE_RT {
  const bool tcp = transport == Transport::Tcp;
  if (frame.size() != kRequestSize + (tcp ? kMbapSize : kCrcSize))
    return tl::make_unexpected(DecodeError::Length);
  if (!tcp && !crc_agrees(frame)) return tl::make_unexpected(DecodeError::Crc);
  ByteReader reader{frame};
  if (tcp && reader.big<std::uint32_t>() != 0) return tl::make_unexpected(DecodeError::Protocol);
  if (tcp && reader.big<std::uint16_t>() != kRequestSize)
    return tl::make_unexpected(DecodeError::Length);
  ReadRequest request;
  request.unit = reader.big<std::uint8_t>();
  const auto function = reader.big<std::uint8_t>();
  if (!known(function)) return tl::make_unexpected(DecodeError::Function);
  request.function = static_cast<Function>(function);
  request.address = reader.big<std::uint16_t>();
  request.count = reader.big<std::uint16_t>();
  if (request.count == 0 || request.count > kMaxRegisters)
    return tl::make_unexpected(DecodeError::Length);
  return request;
}

std::optional<tl::expected<Answer, DecodeError>> decode_answer(std::span<const std::byte> bytes,
                                                               Transport transport,
                                                               const ReadRequest& request) ABBE_RT {
  return transport == Transport::Tcp ? decode_tcp(bytes, request) : decode_rtu(bytes, request);
}

std::string_view name_of(DecodeError error) noexcept {
  switch (error) {
    case DecodeError::Length:
      return "wrong length of the answer";
    case DecodeError::Protocol:
      return "not a Modbus TCP header";
    case DecodeError::Unit:
      return "answer of another unit";
    case DecodeError::Function:
      return "answer to another function";
    case DecodeError::Crc:
      return "wrong CRC";
    case DecodeError::TrailingBytes:
      return "bytes after the answer";
  }

  return "?";
}

std::string_view name_of_exception(std::uint8_t code) noexcept {
  switch (code) {
    case 1:
      return "illegal function";
    case 2:
      return "illegal data address";
    case 3:
      return "illegal data value";
    case 4:
      return "device failure";
    case 5:
      return "acknowledge";
    case 6:
      return "device busy";
    case 8:
      return "memory parity error";
    case 10:
      return "gateway path unavailable";
    case 11:
      return "gateway target does not respond";
    default:
      return "exception";
  }
}

}  // namespace abbe::protocol::modbus
