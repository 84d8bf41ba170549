#include "abbe/protocol/mcap/crc32.hpp"

#include <string_view>
#include <vector>

namespace abbe::protocol::mcap {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text.data(), text.size()});
}

// The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
TEST(Crc32, OfTheNineDigitsIsTheCheckValue) {
  EXPECT_EQ(crc32(bytes_of("123456789")), 0xCBF43926u);
}

TEST(Crc32, OfNothingIsZero) {
  EXPECT_EQ(crc32({}), 0u);
}

TEST(Crc32, OfAnIendChunkIsTheOneInEveryPngFile) {
  EXPECT_EQ(crc32(bytes_of("IEND")), 0xAE426082u);
}

std::uint32_t bit_by_bit(std::span<const std::byte> bytes) {
  std::uint32_t r = 0xFFFFFFFFu;
  for (const std::byte b : bytes) {
    r ^= std::to_integer<std::uint32_t>(b);
    for (int i = 0; i < 8; ++i) r = (r & 1u) != 0 ? (r >> 1) ^ 0xEDB88320u : r >> 1;
  }
  return ~r;
}

TEST(Crc32, AgreesWithTheDefinitionForEveryLengthAndAlignment) {
  std::vector<std::byte> data(80);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<std::byte>(i * 151 + 7);
  for (std::size_t start = 0; start < 9; ++start) {
    for (std::size_t size = 0; start + size <= data.size(); ++size) {
      const auto piece = std::span{data}.subspan(start, size);
      ASSERT_EQ(crc32(piece), bit_by_bit(piece)) << "start " << start << " size " << size;
    }
  }
}

TEST(Crc32, OfPiecesIsThatOfTheWhole) {
  const auto whole = bytes_of("geometric errors of a machine tool");
  for (std::size_t cut = 0; cut <= whole.size(); ++cut) {
    Crc32 crc;
    crc.update(whole.first(cut));
    crc.update(whole.subspan(cut));
    ASSERT_EQ(crc.value(), crc32(whole));
  }
}

}  // namespace
}  // namespace abbe::protocol::mcap
