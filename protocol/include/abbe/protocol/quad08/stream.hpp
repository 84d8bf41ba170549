#pragma once
/// The stream of scans: counts in the order of the list, over packets cut anywhere. Nothing in it
/// says where a scan begins: whoever starts it counts bytes from its first, or seeks by a counter
/// whose step is known. Deterministic, no allocation, total.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/quad08/scan_list.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::quad08 {

/// The counts of one scan as the card sent them: 32 bit, or 48 bit without its sign extended.
using RawScan = std::array<std::uint64_t, kChannels>;

/// Modulus 2^32 or 2^48.
[[nodiscard]] constexpr std::uint64_t modulus_of(CountWidth width) noexcept {
  return std::uint64_t{1} << (width == CountWidth::Bits32 ? 32 : 48);
}
/// The smallest signed step between two readings of a counter that wraps.
[[nodiscard]] constexpr std::int64_t signed_step(std::uint64_t from, std::uint64_t to,
                                                 CountWidth width) noexcept {
  const std::uint64_t modulus = modulus_of(width);
  const std::uint64_t ahead = (to - from) & (modulus - 1);
  return ahead < modulus / 2 ? static_cast<std::int64_t>(ahead)
                             : -static_cast<std::int64_t>(modulus - ahead);
}
/// The same for a counter that never counts down.
[[nodiscard]] constexpr std::uint64_t upward_step(std::uint64_t from, std::uint64_t to,
                                                  CountWidth width) noexcept {
  return (to - from) & (modulus_of(width) - 1);
}

class ScanDecoder {
 public:
  explicit ScanDecoder(const ScanLayout& layout) ABBE_RT : layout_(layout) {}

  /// The stream begins anew with the next byte pushed.
  void reset() ABBE_RT {
    carried_ = 0;
    bytes_ = {};
  }
  /// The bytes are borrowed until next() gives nothing.
  void push(std::span<const std::byte> bytes) ABBE_RT { bytes_ = bytes; }
  /// The next whole scan; nothing: the rest is kept, push more.
  [[nodiscard]] std::optional<RawScan> next() ABBE_RT;

  [[nodiscard]] const ScanLayout& layout() const ABBE_RT { return layout_; }

 private:
  static constexpr std::size_t kLongestScan = kChannels * bytes_of(CountWidth::Bits48);
  [[nodiscard]] RawScan decode(std::span<const std::byte> scan) const ABBE_RT;

  ScanLayout layout_;
  std::span<const std::byte> bytes_;
  std::array<std::byte, kLongestScan> carry_{};
  std::size_t carried_ = 0;
};

/// A counter that advances by a known step from scan to scan.
struct Metronome {
  std::size_t place = 0;   ///< in the scan
  double step = 0.0;       ///< counts per scan
  double tolerance = 2.0;  ///< counts, of one step
  [[nodiscard]] bool beats(std::uint64_t from, std::uint64_t to, CountWidth width) const ABBE_RT;
};

/// Where a scan begins in bytes taken out of a stream: the first offset at which the metronome
/// beats twice. Needs seek_window(layout) bytes to be sure to find one.
[[nodiscard]] std::optional<std::size_t> seek_scan(std::span<const std::byte> bytes,
                                                   const ScanLayout& layout,
                                                   const Metronome& metronome) ABBE_RT;
[[nodiscard]] constexpr std::size_t seek_window(const ScanLayout& layout) noexcept {
  return layout.count == 0 ? 0 : 4 * layout.scan_bytes() - 1;
}

}  // namespace abbe::protocol::quad08
