#pragma once
/// Cuts a TCP byte stream into emScon packets, whichever way they run. A size below 8 or above
/// 65536 is refused. Policy then: TCP loses nothing, so a bad size means that the peer does not
/// speak emScon or that we are out of step; the framer gives nothing more until reset() (a new
/// connection) or resync() (a recording with a hole in it). Fixed buffer, allocation-free; one
/// thread.

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

class PacketFramer {
 public:
  /// Room for one whole packet beside an unfinished one.
  static constexpr std::size_t kCapacity = 2 * kMaxPacketSize;

  /// Takes as many bytes as there is room for and says how many; all of them whenever next() was
  /// called until it gave nothing and no more than kMaxPacketSize come at once.
  std::size_t push(std::span<const std::byte> bytes) ABBE_RT;

  /// The next whole packet, valid until the next push(), reset() or resync(); nothing if none is
  /// complete.
  [[nodiscard]] std::optional<std::span<const std::byte>> next() ABBE_RT;

  /// True from a refused size on.
  [[nodiscard]] bool broken() const ABBE_RT { return broken_; }
  /// The refused bytes, for a message that tells people what does answer there. Empty unless
  /// broken().
  [[nodiscard]] std::span<const std::byte> refused() const ABBE_RT;

  /// Forgets everything: a new connection.
  void reset() ABBE_RT;
  /// Goes on at the next place that looks like the head of a packet from a controller (type 0 to
  /// 11, a size that type can have). A guess, good enough for a recording with lost blocks, never
  /// used on a live connection.
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
