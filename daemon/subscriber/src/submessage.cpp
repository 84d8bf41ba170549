#include "submessage.hpp"

#include <algorithm>

namespace abbe::dds::rtps_message {
namespace {

/// Limits of octetsToInlineQos. Reader id, writer id and sequence number take 16 bytes; Fast DDS
/// replaces a smaller value by 16. Fast DDS reads a signed 16-bit number, hence the upper limit.
constexpr std::size_t kShortestToInlineQos = 16, kLongestToInlineQos = 0x7fff;
/// Key hash and status info (disposed, unregistered) of a sample.
constexpr std::uint16_t kKeyHash = 0x0070, kStatusInfo = 0x0071;

}  // namespace

std::uint32_t entity_id(Bytes bytes, std::size_t at) {
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id = id << 8 | bytes[at + i];
  return id;
}

bool is_users(std::uint32_t entity) {
  return (entity & 0xc0u) != 0xc0u;
}

std::optional<DataLayout> read_data(const Submessage& data, bool users) {
  Reader reader = data.reader();
  const std::size_t to_inline_qos = reader.u16(2);
  if (to_inline_qos < kShortestToInlineQos || to_inline_qos > kLongestToInlineQos)
    return std::nullopt;
  DataLayout layout{.payload = kToInlineQos + to_inline_qos};
  if (!data.has(kInlineQos)) return layout;

  const auto end =
      walk_parameters(reader, layout.payload, [&](std::uint16_t id, std::size_t offset) {
        const std::size_t length = reader.u16(offset + 2);
        if (id == kStatusInfo && length > 0)  // four octets; the last one has the flags
          layout.not_alive |= data.body[offset + 4 + std::min<std::size_t>(length, 4) - 1] != 0;
        if (id == kKeyHash && users) reader.put_u16(offset, kUnusedParameterId);
      });
  if (!end) return std::nullopt;
  layout.payload = *end;
  return layout;
}

}  // namespace abbe::dds::rtps_message
