// Any bytes as the stream of a counter card, cut anywhere: the same scans as in one piece; as a
// scan list and as set-up words: refused, or read and written again to the same.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/stream.hpp"

namespace {

using namespace abbe::protocol::quad08;

void require(bool holds) {
  if (!holds) std::abort();
}

ScanLayout layout_from(std::uint8_t choice) {
  ScanLayout layout{.width = (choice & 0x80) != 0 ? CountWidth::Bits48 : CountWidth::Bits32};
  layout.count = 1 + choice % kChannels;
  for (std::size_t i = 0; i < layout.count; ++i) layout.channels[i] = static_cast<std::uint8_t>(i);
  return layout;
}

void take_all(ScanDecoder& decoder, std::vector<RawScan>& out) {
  while (const auto scan = decoder.next()) out.push_back(*scan);
}

void stream(std::span<const std::byte> bytes) {
  if (bytes.size() < 2) return;
  const auto layout = layout_from(std::to_integer<std::uint8_t>(bytes[0]));
  const auto cut = std::min<std::size_t>(std::to_integer<std::size_t>(bytes[1]), bytes.size() - 2);
  const auto rest = bytes.subspan(2);
  ScanDecoder whole{layout}, pieces{layout};
  std::vector<RawScan> expected, got;
  whole.push(rest);
  take_all(whole, expected);

  for (const auto piece : {rest.first(cut), rest.subspan(cut)}) {
    pieces.push(piece);
    take_all(pieces, got);
  }

  require(got == expected && got.size() == rest.size() / layout.scan_bytes());
  if (const auto at = seek_scan(rest, layout, Metronome{.place = 0, .step = 300.0}))
    require(*at < layout.scan_bytes());
}

void words(std::span<const std::byte> bytes) {
  std::vector<ScanListEntry> entries;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    entries.push_back(
        {std::to_integer<std::uint16_t>(bytes[i]), std::to_integer<std::uint16_t>(bytes[i + 1])});
    const auto word = static_cast<std::uint16_t>(entries.back().word1 << 8 | entries.back().word2);
    if (const auto setup = decode_counter_setup(word))
      require(decode_counter_setup(encode(*setup)) == setup);
  }
  if (const auto layout = decode_scan_list(entries)) {
    const auto again = encode(*layout);
    require(again.count == entries.size() && decode_scan_list(again.used()) == layout);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  stream(bytes);
  words(bytes);
  return 0;
}
