#include "abbe/protocol/quad08/stream.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::quad08 {
namespace {

constexpr std::uint64_t kLow48 = (std::uint64_t{1} << 48) - 1;

std::uint64_t count_at(std::span<const std::byte> bytes, CountWidth width) ABBE_RT {
  ByteReader in{bytes};
  return width == CountWidth::Bits32 ? in.little<std::uint32_t>()
                                     : in.little<std::uint64_t>() & kLow48;
}

}  // namespace

std::optional<RawScan> ScanDecoder::next() ABBE_RT {
  const std::size_t size = layout_.scan_bytes();
  if (size == 0) return std::nullopt;
  if (carried_ == 0 && bytes_.size() >= size) {
    const auto scan = decode(bytes_.first(size));
    bytes_ = bytes_.subspan(size);
    return scan;
  }
  const std::size_t more = std::min(size - carried_, bytes_.size());
  std::copy_n(bytes_.begin(), more, carry_.begin() + static_cast<std::ptrdiff_t>(carried_));
  bytes_ = bytes_.subspan(more);
  carried_ += more;
  if (carried_ < size) return std::nullopt;
  carried_ = 0;
  return decode(std::span{carry_}.first(size));
}

RawScan ScanDecoder::decode(std::span<const std::byte> scan) const ABBE_RT {
  RawScan counts{};
  const std::size_t each = bytes_of(layout_.width);
  for (std::size_t i = 0; i < layout_.count; ++i)
    counts[i] = count_at(scan.subspan(i * each, each), layout_.width);
  return counts;
}

bool Metronome::beats(std::uint64_t from, std::uint64_t to, CountWidth width) const ABBE_RT {
  return std::abs(static_cast<double>(upward_step(from, to, width)) - step) <= tolerance;
}

std::optional<std::size_t> seek_scan(std::span<const std::byte> bytes, const ScanLayout& layout,
                                     const Metronome& metronome) ABBE_RT {
  const std::size_t size = layout.scan_bytes();
  const std::size_t each = bytes_of(layout.width);
  if (size == 0 || metronome.place >= layout.count) return std::nullopt;
  const auto at = [&](std::size_t offset) ABBE_RT {
    return count_at(bytes.subspan(offset + metronome.place * each, each), layout.width);
  };
  for (std::size_t offset = 0; offset < size && offset + 3 * size <= bytes.size(); ++offset) {
    const auto first = at(offset);
    const auto second = at(offset + size);
    const auto third = at(offset + 2 * size);
    if (metronome.beats(first, second, layout.width) &&
        metronome.beats(second, third, layout.width))
      return offset;
  }
  return std::nullopt;
}

}  // namespace abbe::protocol::quad08
