// The request formats of the three protocols of RecordedDialogue.
#include <algorithm>
#include <array>
#include <string_view>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/modbus/read.hpp"
#include "abbe/sim/recorded_dialogue.hpp"

namespace abbe::sim {
namespace {

namespace modbus = protocol::modbus;
using Bytes = DialogueWire::Bytes;

std::vector<std::byte> bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span{text});
  return {bytes.begin(), bytes.end()};
}
std::string_view text_of(Bytes bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}
std::byte operator+(std::byte byte, unsigned bits) {
  return byte | static_cast<std::byte>(bits);
}

// --- Modbus TCP: transaction (2), protocol 0 (2), length (2), unit, function, ...

constexpr std::size_t kTransactionSize = 2;
constexpr std::size_t kBeforeLength = 4;
constexpr std::size_t kUnit = 6;
constexpr unsigned kException = 0x80;
constexpr std::byte kIllegalFunction{1};

std::size_t tcp_request_size(Bytes bytes) {
  if (bytes.size() < kUnit) return 0;
  const std::size_t size =
      kUnit + protocol::ByteReader{bytes.subspan(kBeforeLength)}.big<std::uint16_t>();
  return bytes.size() < size ? 0 : size;
}
Bytes tcp_meaning(Bytes request) {
  return request.subspan(std::min(kUnit, request.size()));
}
void tcp_renumber(std::span<std::byte> answer, Bytes, Bytes request) {
  // Recorded bytes that are not a Modbus answer have no transaction number to replace.
  const bool numbered =
      answer.size() < kBeforeLength ||
      (answer[kTransactionSize] == std::byte{0} && answer[kTransactionSize + 1] == std::byte{0});
  if (numbered)
    std::copy_n(request.begin(), std::min(kTransactionSize, answer.size()), answer.begin());
}
std::vector<std::byte> tcp_refusal(Bytes request) {
  if (request.size() < kUnit + 2) return {};
  constexpr std::byte kLength{3};
  return {request[0],      request[1], std::byte{0},   std::byte{0},
          std::byte{0},    kLength,    request[kUnit], request[kUnit + 1] + kException,
          kIllegalFunction};
}

// --- Modbus RTU: unit, function, address (2), count (2), CRC (2, low byte first). Only read
// requests occur.

constexpr std::size_t kRtuReadSize = 8;

std::size_t rtu_request_size(Bytes bytes) {
  return bytes.size() < kRtuReadSize ? 0 : kRtuReadSize;
}
std::vector<std::byte> rtu_refusal(Bytes request) {
  std::vector<std::byte> out{request[0], request[1] + kException, kIllegalFunction};
  const unsigned crc = modbus::crc16(out);
  out.push_back(static_cast<std::byte>(crc & 0xFFu));
  out.push_back(static_cast<std::byte>(crc >> 8));
  return out;
}

// --- I++ DME: tag (5), space, method, CR LF. Every line of the answer begins with the tag.

constexpr std::size_t kTagSize = 5;

std::size_t line_size(Bytes bytes) {
  const auto end = std::ranges::find(bytes, std::byte{'\n'});
  return end == bytes.end() ? 0 : static_cast<std::size_t>(end - bytes.begin()) + 1;
}
Bytes line_meaning(Bytes line) {
  return line.subspan(std::min(kTagSize + 1, line.size()));
}
void line_renumber(std::span<std::byte> answer, Bytes recorded, Bytes request) {
  if (recorded.size() < kTagSize || request.size() < kTagSize) return;
  for (auto line = answer; !line.empty();) {
    if (text_of(line).starts_with(text_of(recorded.first(kTagSize))))
      std::copy_n(request.begin(), kTagSize, line.begin());
    const std::size_t size = line_size(line);
    line = line.subspan(size == 0 ? line.size() : size);
  }
}
std::vector<std::byte> line_refusal(Bytes request) {
  const std::string tag{text_of(request.first(std::min(kTagSize, request.size())))};
  return bytes_of(tag + " &\r\n" + tag +
                  " ! Error(2,0501,\"replay\",\"Not asked in the recording\")\r\n" + tag +
                  " %\r\n");
}

constexpr DialogueWire kModbusTcp{tcp_request_size, tcp_meaning, tcp_renumber, tcp_refusal};
constexpr DialogueWire kModbusRtu{rtu_request_size, [](Bytes request) { return request; },
                                  [](std::span<std::byte>, Bytes, Bytes) {}, rtu_refusal};
constexpr DialogueWire kIppDme{line_size, line_meaning, line_renumber, line_refusal};

}  // namespace

const DialogueWire& dialogue_wire(RecordedKind kind) {
  if (kind == RecordedKind::ModbusTcp) return kModbusTcp;
  return kind == RecordedKind::ModbusRtu ? kModbusRtu : kIppDme;
}

}  // namespace abbe::sim
