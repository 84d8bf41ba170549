#include "abbe/protocol/position_record.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <vector>

namespace abbe::protocol {
namespace {

constexpr PositionRecord kRecord{
    .homed = true, .cycle = 0xfffffffe, .period_ns = 1'000'000, .position_m = {0.25, -0.5, 1e-9}};

TEST(PositionRecord, ReturnsWhatWasWritten) {
  EXPECT_EQ(decode_position_record(encode(kRecord)), kRecord);
  EXPECT_EQ(decode_position_record(encode({.period_ns = 10'000})),
            PositionRecord{.period_ns = 10'000});
}

TEST(PositionRecord, HasTheDocumentedBytes) {
  const auto bytes = encode(kRecord);
  const auto at = [&](std::size_t i) { return std::to_integer<int>(bytes[i]); };
  EXPECT_EQ((std::vector{at(0), at(1), at(2), at(3)}), (std::vector<int>{'A', 'B', 'B', 'P'}));
  EXPECT_EQ((std::vector{at(4), at(5), at(6), at(7)}), (std::vector{1, 0, 1, 0}));
  EXPECT_EQ((std::vector{at(8), at(9), at(10), at(11)}), (std::vector{0xfe, 0xff, 0xff, 0xff}));
  EXPECT_EQ((std::vector{at(22), at(23)}), (std::vector{0xd0, 0x3f}));  // 0.25 = 0x3fd0...
}

TEST(PositionRecord, RefusesEverythingElse) {
  const auto good = encode(kRecord);
  std::vector<std::byte> bytes(good.begin(), good.end());
  bytes.pop_back();
  EXPECT_FALSE(decode_position_record(bytes));
  bytes.resize(kPositionRecordBytes + 1);
  EXPECT_FALSE(decode_position_record(bytes));
  EXPECT_FALSE(decode_position_record({}));
  for (const std::size_t changed : {0U, 4U, 5U, 6U, 7U}) {
    auto wrong = good;
    wrong[changed] ^= std::byte{0x80};
    EXPECT_FALSE(decode_position_record(wrong)) << changed;
  }
  PositionRecord record = kRecord;
  for (const std::uint32_t period_ns : {0U, 9'999U, 100'000'001U, 0xffffffffU}) {
    record.period_ns = period_ns;
    EXPECT_FALSE(decode_position_record(encode(record))) << period_ns;
  }
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    record = kRecord;
    record.position_m[1] = bad;
    EXPECT_FALSE(decode_position_record(encode(record)));
  }
}

}  // namespace
}  // namespace abbe::protocol
