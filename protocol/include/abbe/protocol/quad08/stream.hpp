#pragma once
/// The stream of scans: counts in the order of the scan list, in packets that may end anywhere in a
/// scan. The stream does not mark the beginning of a scan. It is found by counting bytes from the
/// start of the stream, or with a counter whose step per scan is known. Deterministic, no
/// allocation, accepts any bytes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/quad08/scan_list.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::quad08 {

/// The counts of one scan as sent by the card: 32 bits, or 48 bits without sign extension.
using RawScan = std::array<std::uint64_t, kChannels>;

/// Number of counts after which a counter of this width wraps.
[[nodiscard]] constexpr std::uint64_t modulus_of(CountWidth width) noexcept {
  return std::uint64_t{1} << (width == CountWidth::Bits32 ? 32 : 48);
}
/// The signed step of smallest magnitude between two readings of a counter that wraps.
[[nodiscard]] constexpr std::int64_t signed_step(std::uint64_t from, std::uint64_t to,
                                                 CountWidth width) noexcept {
  const std::uint64_t modulus = modulus_of(width);
  const std::uint64_t ahead = (to - from) & (modulus - 1);
  return ahead < modulus / 2 ? static_cast<std::int64_t>(ahead)
                             : -static_cast<std::int64_t>(modulus - ahead);
}
/// The step of a counter that wraps and never counts down.
[[nodiscard]] constexpr std::uint64_t upward_step(std::uint64_t from, std::uint64_t to,
                                                  CountWidth width) noexcept {
  return (to - from) & (modulus_of(width) - 1);
}

class ScanDecoder {
 public:
  explicit ScanDecoder(const ScanLayout& layout) ABBE_RT : layout_(layout) {}

  /// Discards an incomplete scan: the next pushed byte is the first byte of a scan.
  void reset() ABBE_RT {
    carried_ = 0;
    bytes_ = {};
  }
  /// Takes bytes of the stream, which must remain valid until next() returns nullopt.
  void push(std::span<const std::byte> bytes) ABBE_RT { bytes_ = bytes; }
  /// The next complete scan; nullopt if more bytes are needed. Bytes of an incomplete scan are
  /// kept.
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
  std::size_t place = 0;   ///< position in the scan
  double step = 0.0;       ///< counts per scan
  double tolerance = 2.0;  ///< counts per step
  [[nodiscard]] bool beats(std::uint64_t from, std::uint64_t to, CountWidth width) const ABBE_RT;
};

/// Finds the beginning of a scan in bytes from the middle of a stream: the first offset at which
/// the counter of `metronome` makes two consecutive valid steps. With seek_window(layout) bytes it
/// is always found.
[[nodiscard]] std::optional<std::size_t> seek_scan(std::span<const std::byte> bytes,
                                                   const ScanLayout& layout,
                                                   const Metronome& metronome) ABBE_RT;
[[nodiscard]] constexpr std::size_t seek_window(const ScanLayout& layout) noexcept {
  return layout.count == 0 ? 0 : 4 * layout.scan_bytes() - 1;
}

}  // namespace abbe::protocol::quad08
