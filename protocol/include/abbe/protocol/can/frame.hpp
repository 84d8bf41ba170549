#pragma once
/// One CAN frame, classic or FD, as plain data. Bus transports deliver it, and the decoders of this
/// folder read it. Pure data; safe to copy between threads.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <type_traits>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::can {

/// Properties of a frame. Each is a bit, so that a frame can have several.
enum class FrameFlag : std::uint8_t {
  Extended = 1u << 0,  ///< 29-bit identifier
  Remote = 1u << 1,    ///< remote request: `length` is the requested length, there are no data
  /// error frame of the local controller; `id` contains Linux error class bits (see
  /// error_frame.hpp)
  Error = 1u << 2,
  Fd = 1u << 3,  ///< CAN FD format: up to 64 bytes, `fd_flags` contains BRS (1) and ESI (2)
};

struct CanFrame {
  static constexpr std::size_t kMaxClassicData = 8;
  static constexpr std::size_t kMaxData = 64;
  static constexpr std::uint32_t kStandardMask = 0x7FF;
  static constexpr std::uint32_t kExtendedMask = 0x1FFFFFFF;

  std::uint32_t id = 0;  ///< 11 or 29 bits, no flag bits
  std::uint8_t flags = 0;
  std::uint8_t fd_flags = 0;
  std::uint8_t length = 0;    ///< valid bytes of `data`; in a remote frame: requested bytes
  std::uint8_t reserved = 0;  ///< always 0, so that equal frames have equal bytes
  std::array<std::byte, kMaxData> data{};

  [[nodiscard]] constexpr bool is(FrameFlag f) const ABBE_RT {
    return (flags & static_cast<std::uint8_t>(f)) != 0;
  }
  constexpr void set(FrameFlag f) ABBE_RT {
    flags = static_cast<std::uint8_t>(flags | static_cast<std::uint8_t>(f));
  }
  /// True for a data frame with an 11-bit identifier, the only kind that CANopen uses.
  [[nodiscard]] constexpr bool is_standard_data() const ABBE_RT {
    return !is(FrameFlag::Extended) && !is(FrameFlag::Remote) && !is(FrameFlag::Error);
  }
  /// The payload; empty for remote frames, at most kMaxData bytes for any `length`.
  [[nodiscard]] constexpr std::span<const std::byte> payload() const ABBE_RT {
    return {data.data(), is(FrameFlag::Remote) ? 0 : std::min<std::size_t>(length, kMaxData)};
  }
  [[nodiscard]] constexpr std::uint8_t byte(std::size_t i) const ABBE_RT {
    return i < kMaxData ? std::to_integer<std::uint8_t>(data[i]) : std::uint8_t{0};
  }

  friend bool operator==(const CanFrame&, const CanFrame&) = default;
};
static_assert(std::is_trivially_copyable_v<CanFrame>);
static_assert(sizeof(CanFrame) == 72);

/// A classic data frame with an 11-bit identifier; bytes after the eighth are ignored.
[[nodiscard]] constexpr CanFrame standard_frame(std::uint32_t id,
                                                std::span<const std::byte> payload) ABBE_RT {
  CanFrame frame;
  frame.id = id & CanFrame::kStandardMask;
  const auto n = std::min(payload.size(), CanFrame::kMaxClassicData);
  frame.length = static_cast<std::uint8_t>(n);
  std::copy_n(payload.begin(), n, frame.data.begin());
  return frame;
}
[[nodiscard]] constexpr CanFrame standard_frame(
    std::uint32_t id, std::initializer_list<std::uint8_t> payload) ABBE_RT {
  std::array<std::byte, CanFrame::kMaxClassicData> bytes{};
  std::size_t n = 0;
  for (const auto value : payload) {
    if (n < bytes.size()) bytes[n++] = std::byte{value};
  }
  return standard_frame(id, std::span<const std::byte>{bytes.data(), n});
}

}  // namespace abbe::protocol::can
