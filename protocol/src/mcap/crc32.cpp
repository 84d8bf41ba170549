#include "abbe/protocol/mcap/crc32.hpp"

#include <array>
#include <bit>
#include <cstring>

namespace abbe::protocol::mcap {
namespace {

constexpr std::uint32_t kReflectedPolynomial = 0xEDB88320u;
constexpr std::size_t kSlices = 8;
using Tables = std::array<std::array<std::uint32_t, 256>, kSlices>;

/// tables[0] advances the CRC register by one byte, tables[k] by one byte and k zero bytes.
constexpr Tables make_tables() {
  Tables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t r = byte;
    for (int bit = 0; bit < 8; ++bit) r = (r >> 1) ^ ((r & 1u) != 0 ? kReflectedPolynomial : 0u);
    tables[0][byte] = r;
  }

  for (std::size_t k = 1; k < kSlices; ++k) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t r = tables[k - 1][byte];
      tables[k][byte] = (r >> 8) ^ tables[0][r & 0xFFu];
    }
  }

  return tables;
}

constexpr Tables kTables = make_tables();

static_assert(std::endian::native == std::endian::little,
              "load() below reads little-endian words in place");

std::uint32_t load(const std::byte* p) noexcept {
  std::uint32_t word = 0;
  std::memcpy(&word, p, sizeof word);
  return word;
}

std::uint32_t eight_bytes(std::uint32_t state, const std::byte* p) noexcept {
  const std::uint32_t a = load(p) ^ state;
  const std::uint32_t b = load(p + 4);
  return kTables[7][a & 0xFFu] ^ kTables[6][(a >> 8) & 0xFFu] ^ kTables[5][(a >> 16) & 0xFFu] ^
         kTables[4][a >> 24] ^ kTables[3][b & 0xFFu] ^ kTables[2][(b >> 8) & 0xFFu] ^
         kTables[1][(b >> 16) & 0xFFu] ^ kTables[0][b >> 24];
}

}  // namespace

void Crc32::update(std::span<const std::byte> bytes) noexcept {
  std::uint32_t state = state_;
  while (bytes.size() >= kSlices) {
    state = eight_bytes(state, bytes.data());
    bytes = bytes.subspan(kSlices);
  }
  for (const std::byte b : bytes) {
    state = (state >> 8) ^ kTables[0][(state ^ std::to_integer<std::uint32_t>(b)) & 0xFFu];
  }
  state_ = state;
}

std::uint32_t crc32(std::span<const std::byte> bytes) noexcept {
  Crc32 crc;
  crc.update(bytes);
  return crc.value();
}

}  // namespace abbe::protocol::mcap
