#include "abbe/protocol/raw_bytes_cdr.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

namespace abbe::protocol {
namespace {

using namespace std::chrono_literals;

constexpr std::array<std::byte, 3> kBytes{std::byte{0xAA}, std::byte{0xBB}, std::byte{0xCC}};
const RawBytes kValue{
    "laser", HostTime{0x0102030405060708ns}, 9, RawBlock::Direction::ToDevice, true, kBytes};

std::vector<std::byte> encoded(const RawBytes& value) {
  std::vector<std::byte> out(kMaxRawBytesCdrSize);
  const auto size = encode_cdr(value, out);
  EXPECT_TRUE(size);
  out.resize(size.value_or(0));
  return out;
}

CdrError error_of(std::span<const std::byte> cdr) {
  const auto decoded = decode_raw_bytes_cdr(cdr);
  EXPECT_FALSE(decoded);
  return decoded ? CdrError::BufferTooSmall : decoded.error();
}

TEST(RawBytesCdr, IsLaidOutAsXcdr1) {
  const std::string_view expected{
      "\x00\x01\x00\x00"
      "\x06\0\0\0laser\0"
      "\0\0\0\0\0\0"  // length with NUL, then to a multiple of 8
      "\x08\x07\x06\x05\x04\x03\x02\x01"
      "\x09\0\0\0"
      "\x01\x01"
      "\0\0"  // to a multiple of 4
      "\x03\0\0\0\xAA\xBB\xCC",
      4 + 16 + 8 + 4 + 4 + 7};
  EXPECT_TRUE(std::ranges::equal(encoded(kValue), std::as_bytes(std::span{expected})));
}

TEST(RawBytesCdr, SurvivesARoundTripForEveryNameLength) {
  for (std::size_t length = 0; length <= kMaxDeviceNameLength; ++length) {
    const std::string name(length, 'd');
    RawBytes value = kValue;
    value.device = name;
    const auto cdr = encoded(value);
    const auto back = decode_raw_bytes_cdr(cdr);
    ASSERT_TRUE(back) << length;
    EXPECT_EQ(back->device, name);
    EXPECT_EQ(back->time, value.time);
    EXPECT_EQ(back->lost_before, value.lost_before);
    EXPECT_EQ(back->direction, value.direction);
    EXPECT_EQ(back->continued, value.continued);
    EXPECT_TRUE(std::ranges::equal(back->bytes, value.bytes));
  }
}

TEST(RawBytesCdr, TheLargestValueFitsTheLargestSize) {
  const std::string name(kMaxDeviceNameLength, 'd');
  const std::vector<std::byte> bytes(RawBlock::kCapacity);
  RawBytes value = kValue;
  value.device = name;
  value.bytes = bytes;
  EXPECT_EQ(encoded(value).size(), kMaxRawBytesCdrSize);
}

TEST(RawBytesCdr, EveryShortenedEncodingIsRefused) {
  const auto cdr = encoded(kValue);
  for (std::size_t size = 0; size < cdr.size(); ++size) {
    EXPECT_EQ(error_of(std::span{cdr}.first(size)), CdrError::Truncated) << size;
  }
}

TEST(RawBytesCdr, BytesOutsideTheIdlsBoundsAreRefused) {
  const auto with = [](std::size_t at, std::uint8_t value) {
    auto cdr = encoded(kValue);
    cdr[at] = std::byte{value};
    return cdr;
  };
  EXPECT_EQ(error_of(with(1, 0)), CdrError::NotCdrLe);      // big endian
  EXPECT_EQ(error_of(with(4, 34)), CdrError::OutOfBounds);  // a name of 33
  EXPECT_EQ(error_of(with(13, 'x')), CdrError::BadString);  // no NUL at the end
  EXPECT_EQ(error_of(with(9, 0)), CdrError::BadString);     // a NUL inside
  EXPECT_EQ(error_of(with(32, 2)), CdrError::BadBool);
  EXPECT_EQ(error_of(with(37, 9)), CdrError::OutOfBounds);  // more than 2048 bytes
}

TEST(RawBytesCdr, ValuesOutsideTheIdlsBoundsAreNotWritten) {
  std::vector<std::byte> out(2 * kMaxRawBytesCdrSize);
  RawBytes value = kValue;
  value.device = "a device whose name is much too long";
  EXPECT_EQ(encode_cdr(value, out).error(), CdrError::OutOfBounds);
  const std::vector<std::byte> bytes(RawBlock::kCapacity + 1);
  value = kValue;
  value.bytes = bytes;
  EXPECT_EQ(encode_cdr(value, out).error(), CdrError::OutOfBounds);
  EXPECT_EQ(encode_cdr(kValue, std::span{out}.first(42)).error(), CdrError::BufferTooSmall);
}

TEST(RawBytesCdr, ABlockBecomesAValueAndABlockAgain) {
  RawBlock block;
  block.time = HostTime{5s};
  block.lost_before = 2;
  block.length = 3;
  block.continued = true;
  block.direction = RawBlock::Direction::ToDevice;
  std::ranges::copy(kBytes, block.bytes.begin());
  RawBlock back;
  to_raw_block(to_raw_bytes(block, "laser"), back);

  EXPECT_EQ(back.time, block.time);
  EXPECT_EQ(back.lost_before, block.lost_before);
  EXPECT_EQ(back.length, block.length);
  EXPECT_EQ(back.continued, block.continued);
  EXPECT_EQ(back.direction, block.direction);
  EXPECT_TRUE(std::equal(kBytes.begin(), kBytes.end(), back.bytes.begin()));
}

}  // namespace
}  // namespace abbe::protocol
