#include "abbe/protocol/emscon/framer.hpp"

#include <algorithm>
#include <cstring>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/emscon/results.hpp"

namespace abbe::protocol::emscon {
namespace {

constexpr std::size_t kSmallestFromController = 12;

bool acceptable(std::size_t size) ABBE_RT {
  return size >= kHeaderSize && size <= kMaxPacketSize;
}

bool looks_like_a_head(std::span<const std::byte> bytes) ABBE_RT {
  ByteReader in{bytes};
  const std::size_t size = in.little<std::uint32_t>();
  const auto type = in.little<PacketType>();
  if (size < kSmallestFromController || size > kMaxPacketSize) return false;

  switch (type) {
    case PacketType::MultiResult:
      return size >= kMultiHeadSize && (size - kMultiHeadSize) % kMultiPointSize == 0;
    case PacketType::MultiResult2:
      return size >= kMultiHeadSize && (size - kMultiHeadSize) % kExtendedMultiPointSize == 0;
    case PacketType::SingleResult:
      return size == 156;
    case PacketType::ReflectorPosition:
      return size == 36;
    case PacketType::StatusChange:
      return size == 12;
    case PacketType::Error:
      return size == 16;
    case PacketType::Command:
      return size >= 16 && size <= kMaxAnswerSize;
    default:
      return static_cast<std::int32_t>(type) >= 4 && static_cast<std::int32_t>(type) <= 11;
  }
}

}  // namespace

std::size_t PacketFramer::push(std::span<const std::byte> bytes) ABBE_RT {
  if (bytes.empty()) return 0;
  if (bytes.size() > kCapacity - end_) compact();
  const std::size_t count = std::min(bytes.size(), kCapacity - end_);
  std::memcpy(buffer_.data() + end_, bytes.data(), count);
  end_ += count;
  return count;
}

std::optional<std::span<const std::byte>> PacketFramer::next() ABBE_RT {
  if (seeking_) seek();
  if (broken_ || seeking_ || unread().size() < kHeaderSize) return std::nullopt;
  ByteReader in{unread()};
  const std::size_t size = in.little<std::uint32_t>();
  broken_ = !acceptable(size);
  if (broken_ || unread().size() < size) return std::nullopt;
  const auto packet = unread().first(size);
  begin_ += size;
  return packet;
}

std::span<const std::byte> PacketFramer::refused() const ABBE_RT {
  return broken_ ? unread() : std::span<const std::byte>{};
}

void PacketFramer::reset() ABBE_RT {
  begin_ = end_ = 0;
  broken_ = seeking_ = false;
}

void PacketFramer::resync() ABBE_RT {
  broken_ = false;
  seeking_ = true;
}

void PacketFramer::compact() ABBE_RT {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
}

void PacketFramer::seek() ABBE_RT {
  while (unread().size() >= kHeaderSize && !looks_like_a_head(unread())) ++begin_;
  seeking_ = unread().size() < kHeaderSize;
}

}  // namespace abbe::protocol::emscon
