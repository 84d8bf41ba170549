#pragma once
/// Scan list of the card: the counters in a scan, their width, and the scan rate
/// [MCC uldaq, CtrUsbQuad08, MIT]. On the wire a scan consists of the words in the order of the
/// list, little-endian, without header, time or number.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/quad08/registers.hpp"

namespace abbe::protocol::quad08 {

enum class CountWidth : std::uint8_t { Bits32, Bits48 };

/// A count of 48 bits is transferred as 64 bits: the fourth word of the counter is read, too.
[[nodiscard]] constexpr std::size_t words_of(CountWidth width) noexcept {
  return width == CountWidth::Bits32 ? 2 : 4;
}
[[nodiscard]] constexpr std::size_t bytes_of(CountWidth width) noexcept {
  return 2 * words_of(width);
}

struct ScanLayout {
  std::array<std::uint8_t, kChannels> channels{};  ///< channels in the order of the list
  std::size_t count = 0;
  CountWidth width = CountWidth::Bits32;

  [[nodiscard]] constexpr std::size_t scan_bytes() const noexcept {
    return count * bytes_of(width);
  }
  [[nodiscard]] constexpr std::span<const std::uint8_t> used() const noexcept {
    return std::span{channels}.first(count);
  }
  /// Position of a channel in a scan.
  [[nodiscard]] constexpr std::optional<std::size_t> place_of(std::uint8_t channel) const noexcept {
    for (std::size_t i = 0; i < count; ++i)
      if (channels[i] == channel) return i;
    return std::nullopt;
  }
  friend bool operator==(const ScanLayout&, const ScanLayout&) = default;
};

/// One entry of the list: two register writes.
struct ScanListEntry {
  std::uint16_t word1 = 0;
  std::uint16_t word2 = 0;
};
struct ScanListEntries {
  std::array<ScanListEntry, kChannels * 4> entries{};
  std::size_t count = 0;
  [[nodiscard]] std::span<const ScanListEntry> used() const noexcept {
    return std::span{entries}.first(count);
  }
};
[[nodiscard]] ScanListEntries encode(const ScanLayout& layout) ABBE_RT;
/// The layout that results from a list; nullopt for an invalid list: no first or last entry, words
/// of a counter not adjacent, mixed widths.
[[nodiscard]] std::optional<ScanLayout> decode_scan_list(
    std::span<const ScanListEntry> entries) ABBE_RT;

/// Pacer divisor for `rate_hz`, rounded down as in the manufacturer's library; see pacer_rate_hz()
/// for the resulting rate. nullopt for a rate that the card does not support (not positive, above 8
/// MHz, below once per day).
[[nodiscard]] std::optional<std::uint64_t> pacer_divisor(double rate_hz) ABBE_RT;
/// The actual rate of a divisor.
[[nodiscard]] constexpr double pacer_rate_hz(std::uint64_t divisor) noexcept {
  return kPacerClock_hz / (static_cast<double>(divisor) + 1.0);
}

}  // namespace abbe::protocol::quad08
