#include "abbe/protocol/bytes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

namespace abbe::protocol {
namespace {

using testing::ElementsAre;

TEST(ByteWriter, PutsTheLowByteFirstInLittleOrder) {
  std::array<std::byte, 4> out{};
  ByteWriter writer{out};
  writer.little(std::uint32_t{0x01020304});
  EXPECT_THAT(out, ElementsAre(std::byte{4}, std::byte{3}, std::byte{2}, std::byte{1}));
}

TEST(ByteWriter, PutsTheHighByteFirstInBigOrder) {
  std::array<std::byte, 2> out{};
  ByteWriter writer{out};
  writer.big(std::uint16_t{0x0102});
  EXPECT_THAT(out, ElementsAre(std::byte{1}, std::byte{2}));
}

TEST(ByteWriter, WritesNothingPastItsEnd) {
  std::array<std::byte, 4> out{};
  ByteWriter writer{std::span{out}.first(3)};
  writer.little(std::uint16_t{0xffff});
  writer.little(std::uint16_t{0xffff});
  writer.little(std::uint8_t{0xff});  // would fit, but the failure is sticky
  EXPECT_FALSE(writer.ok());
  EXPECT_EQ(writer.size(), 2u);
  EXPECT_EQ(out[2], std::byte{0});
}

TEST(ByteReader, ReadsBackWhatWasWritten) {
  std::array<std::byte, 32> out{};
  ByteWriter writer{out};
  writer.little(-2.5);
  writer.big(std::int64_t{-3});
  writer.big(1.25f);
  writer.zeros(2);
  ByteReader reader{writer.written()};

  EXPECT_EQ(reader.little<double>(), -2.5);
  EXPECT_EQ(reader.big<std::int64_t>(), -3);
  EXPECT_EQ(reader.big<float>(), 1.25f);
  EXPECT_EQ(reader.take(2).size(), 2u);
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.remaining(), 0u);
}

TEST(ByteReader, GivesZeroPastItsEndAndReportsIt) {
  const std::array<std::byte, 3> in{std::byte{1}, std::byte{2}, std::byte{3}};
  ByteReader reader{in};
  EXPECT_EQ(reader.little<std::uint32_t>(), 0u);
  EXPECT_FALSE(reader.ok());
  EXPECT_EQ(reader.little<std::uint8_t>(), 0);
  EXPECT_TRUE(reader.take(1).empty());
}

}  // namespace
}  // namespace abbe::protocol
