#include "abbe/protocol/can/pdo.hpp"

#include "can/little_endian.hpp"

namespace abbe::protocol::can {

std::optional<std::int64_t> decode_position(std::span<const std::byte> payload, PositionType type,
                                            std::size_t offset) ABBE_RT {
  if (offset > payload.size() || payload.size() - offset < size_of(type)) return std::nullopt;
  switch (type) {
    case PositionType::Signed32:
      return static_cast<std::int32_t>(load_le<std::uint32_t>(payload, offset));
    case PositionType::Unsigned32:
      return load_le<std::uint32_t>(payload, offset);
    case PositionType::Signed64:
      return static_cast<std::int64_t>(load_le<std::uint64_t>(payload, offset));
  }
  return std::nullopt;
}

CanFrame encode_position(std::uint32_t cob_id, PositionType type, std::int64_t count) ABBE_RT {
  auto frame = standard_frame(cob_id, std::span<const std::byte>{});
  frame.length = static_cast<std::uint8_t>(size_of(type));
  store_le(std::span{frame.data}, 0, static_cast<std::uint64_t>(count), size_of(type));
  return frame;
}

}  // namespace abbe::protocol::can
