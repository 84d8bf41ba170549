#pragma once
/// Splits a TCP byte stream into emScon packets, in either direction. A size below 8 or above 65536
/// is refused. TCP loses no bytes, so an invalid size means that the peer does not use emScon, or
/// that the framer does not start at a packet boundary. After that the framer returns no packet
/// until reset() (a new connection) or resync() (a recording with a gap). Fixed buffer,
/// allocation-free; one thread.

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

class PacketFramer {
 public:
  /// One complete packet and one incomplete packet.
  static constexpr std::size_t kCapacity = 2 * kMaxPacketSize;

  /// Takes as many bytes as fit and returns their number. All bytes fit if next() was called until
  /// it returned nullopt and there are at most kMaxPacketSize bytes.
  std::size_t push(std::span<const std::byte> bytes) ABBE_RT;

  /// The next complete packet, valid until the next push(), reset() or resync(); nullopt if there
  /// is none.
  [[nodiscard]] std::optional<std::span<const std::byte>> next() ABBE_RT;

  /// True after a size was refused.
  [[nodiscard]] bool broken() const ABBE_RT { return broken_; }
  /// The refused bytes, for a message that shows what the peer sent. Empty unless broken().
  [[nodiscard]] std::span<const std::byte> refused() const ABBE_RT;

  /// Discards all bytes: for a new connection.
  void reset() ABBE_RT;
  /// Continues at the next bytes that have the form of a packet header from a controller (type 0 to
  /// 11, and a size that is possible for the type). This may find a wrong position. It is
  /// sufficient for a recording with lost blocks and is not used on a live connection.
  void resync() ABBE_RT;

 private:
  void compact() ABBE_RT;
  void seek() ABBE_RT;
  [[nodiscard]] std::span<const std::byte> unread() const ABBE_RT {
    return std::span<const std::byte>{buffer_}.subspan(begin_, end_ - begin_);
  }

  std::array<std::byte, kCapacity> buffer_{};
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool broken_ = false;
  bool seeking_ = false;
};

}  // namespace abbe::protocol::emscon
