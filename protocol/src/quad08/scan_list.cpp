#include "abbe/protocol/quad08/scan_list.hpp"

#include <algorithm>

namespace abbe::protocol::quad08 {
namespace {

constexpr std::uint16_t kCounterWord = 0x3;  // digital, internal
constexpr std::uint16_t kLastOfScan = 0x4;
// The word is sampled at the instant of the scan's first word ("sample and hold").
constexpr std::uint16_t kNotFirstOfScan = 0x8;
constexpr unsigned kChannelShift = 4;
constexpr std::uint16_t kFirstWord = 2 * static_cast<std::uint16_t>(Register::CounterWord0);
constexpr double kHighestRate_hz = 8e6;
constexpr double kLowestRate_hz = 1.0 / 86400.0;

struct Place {
  std::uint8_t channel;
  std::size_t word;
};

std::optional<Place> place_of(const ScanListEntry& entry) ABBE_RT {
  const std::size_t channel = entry.word1 >> kChannelShift;
  if ((entry.word1 & kCounterWord) != kCounterWord || channel >= kChannels) return std::nullopt;
  if (entry.word2 < kFirstWord || entry.word2 % 2 != 0) return std::nullopt;
  return Place{static_cast<std::uint8_t>(channel), (entry.word2 - kFirstWord) / 2u};
}

bool marked(const ScanListEntry& entry, bool first, bool last) ABBE_RT {
  return ((entry.word1 & kNotFirstOfScan) == 0) == first &&
         ((entry.word1 & kLastOfScan) != 0) == last;
}

}  // namespace

ScanListEntries encode(const ScanLayout& layout) ABBE_RT {
  ScanListEntries out;
  const std::size_t words = words_of(layout.width);
  const std::size_t total = std::min(layout.count, kChannels) * words;
  for (std::size_t i = 0; i < total; ++i) {
    unsigned word1 = kCounterWord | static_cast<unsigned>(layout.channels[i / words])
                                        << kChannelShift;
    if (i != 0) word1 |= kNotFirstOfScan;
    if (i + 1 == total) word1 |= kLastOfScan;
    out.entries[out.count++] = {static_cast<std::uint16_t>(word1),
                                static_cast<std::uint16_t>(kFirstWord + 2 * (i % words))};
  }
  return out;
}

std::optional<ScanLayout> decode_scan_list(std::span<const ScanListEntry> entries) ABBE_RT {
  ScanLayout layout;
  if (entries.empty()) return std::nullopt;
  const auto first = place_of(entries[0]);
  if (!first) return std::nullopt;

  // The number of consecutive words of the first counter gives the width.
  std::size_t words = 1;
  while (words < entries.size() && entries[words].word1 >> kChannelShift == first->channel) ++words;
  if (words != words_of(CountWidth::Bits32) && words != words_of(CountWidth::Bits48))
    return std::nullopt;
  layout.width = words == words_of(CountWidth::Bits32) ? CountWidth::Bits32 : CountWidth::Bits48;
  if (entries.size() % words != 0 || entries.size() / words > kChannels) return std::nullopt;

  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto place = place_of(entries[i]);
    if (!place || place->word != i % words || !marked(entries[i], i == 0, i + 1 == entries.size()))
      return std::nullopt;
    if (place->word == 0) {
      if (layout.place_of(place->channel)) return std::nullopt;
      layout.channels[layout.count++] = place->channel;
    } else if (place->channel != layout.channels[layout.count - 1]) {
      return std::nullopt;
    }
  }
  return layout;
}

std::optional<std::uint64_t> pacer_divisor(double rate_hz) ABBE_RT {
  if (!(rate_hz >= kLowestRate_hz && rate_hz <= kHighestRate_hz)) return std::nullopt;
  return static_cast<std::uint64_t>(kPacerClock_hz / rate_hz - 1.0);
}

}  // namespace abbe::protocol::quad08
