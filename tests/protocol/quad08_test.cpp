#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "abbe/protocol/quad08/sequences.hpp"
#include "abbe/protocol/quad08/stream.hpp"

namespace abbe::protocol::quad08 {
namespace {

ScanLayout layout_of(std::initializer_list<std::uint8_t> channels,
                     CountWidth width = CountWidth::Bits32) {
  ScanLayout layout{.width = width};
  for (const auto c : channels) layout.channels[layout.count++] = c;
  return layout;
}

TEST(Quad08Channel, SetupWordsAreThoseOfTheMakersLibrary) {
  EXPECT_EQ(encode(CounterSetup{.mode = CounterMode::Encoder}), 0x0815);
  EXPECT_EQ(encode(CounterSetup{.mode = CounterMode::Encoder, .register_reading = true}), 0x2815);
  EXPECT_EQ(encode(CounterSetup{.mode = CounterMode::Encoder, .latch_on_index = true}), 0x0855);
  EXPECT_EQ(encode(CounterSetup{}), 0x0801);
  EXPECT_EQ(encode(CounterSetup{.latch_on_index = true}), 0x0841);
}

TEST(Quad08Channel, SetupWordsAreReadBack) {
  for (const auto mode : {CounterMode::Count, CounterMode::Encoder}) {
    for (const bool latch : {false, true}) {
      const CounterSetup setup{.mode = mode, .latch_on_index = latch};
      EXPECT_EQ(decode_counter_setup(encode(setup)), setup);
    }
  }
  EXPECT_FALSE(decode_counter_setup(0x0800));
}

TEST(Quad08Channel, DebounceOffIsChannelOnAlone) {
  EXPECT_EQ(encode(Debounce{}), 0x80);
  const Debounce filtered{
      .enabled = true, .time_code = 8, .falling = true, .trigger_before_stable = true};
  EXPECT_EQ(encode(filtered), 0xF8);
}

TEST(Quad08Channel, IsSetUpThroughItsBank) {
  const auto writes = channel_writes(6, CounterSetup{.latch_on_index = true}, {}, {});
  EXPECT_EQ(writes[0], write(Register::CounterBank, 6));
  EXPECT_EQ(writes[1], write(Register::DebouncePhases, 0x8080));
  EXPECT_EQ(writes[3], write(Register::DebounceIndex, 0x8080));
  EXPECT_EQ(writes[5], write(Register::CounterSetup, 0x0841));
  EXPECT_EQ(writes[6], write(Register::CounterBank, 0x36));
  EXPECT_EQ(writes[11], write(Register::CounterSetup, 0xFFFF));
}

TEST(Quad08ScanList, MarksFirstAndLastWord) {
  const auto list = encode(layout_of({0, 5}));
  ASSERT_EQ(list.count, 4u);
  EXPECT_EQ(list.entries[0].word1, 0x03);
  EXPECT_EQ(list.entries[0].word2, 0x60);
  EXPECT_EQ(list.entries[1].word1, 0x0B);
  EXPECT_EQ(list.entries[1].word2, 0x62);
  EXPECT_EQ(list.entries[3].word1, 0x5F);
}

TEST(Quad08ScanList, IsReadBackByTheCard) {
  for (const auto width : {CountWidth::Bits32, CountWidth::Bits48}) {
    const auto layout = layout_of({0, 1, 2, 3, 4, 5, 6, 7}, width);
    EXPECT_EQ(decode_scan_list(encode(layout).used()), layout);
  }
}

TEST(Quad08ScanList, RefusesAListWithoutItsEnd) {
  const auto list = encode(layout_of({0, 1}));
  EXPECT_FALSE(decode_scan_list(list.used().first(2)));
  EXPECT_FALSE(decode_scan_list(list.used().subspan(2)));
  EXPECT_FALSE(decode_scan_list({}));
}

TEST(Quad08ScanList, DivisorsAreThoseOfTheMakersLibrary) {
  EXPECT_EQ(pacer_divisor(32e3), 1499u);
  EXPECT_EQ(pacer_divisor(100e3 / 3.0), 1439u);
  EXPECT_EQ(pacer_divisor(33e3), 1453u);
  EXPECT_NEAR(pacer_rate_hz(1453), 33012.38, 0.01);
  EXPECT_FALSE(pacer_divisor(0.0));
  EXPECT_FALSE(pacer_divisor(9e6));
}

TEST(Quad08Sequences, SelfTestReadsBackEightPatterns) {
  const auto sequence = open_sequence();
  const auto reads = std::ranges::count_if(
      sequence.steps(), [](const Step& s) { return s.expect == Expect::LowByte; });
  EXPECT_EQ(reads, 16);  // done twice
  EXPECT_EQ(sequence.steps().front().setup, read_firmware_version());
  EXPECT_FALSE(fulfilled(sequence.steps().front(), 0x00FF));
  EXPECT_TRUE(fulfilled(sequence.steps().front(), 0x0100));
}

TEST(Quad08Sequences, LongestListFits) {
  const auto sequence =
      load_sequence(layout_of({0, 1, 2, 3, 4, 5, 6, 7}, CountWidth::Bits48), 1439);
  EXPECT_LT(sequence.steps().size(), Sequence::kCapacity);
  EXPECT_EQ(sequence.steps().back().setup, usb::clear_halt(kScanEndpoint));
}

TEST(Quad08Status, IsReadyWithAFullPipeBetweenScans) {
  EXPECT_TRUE(Status{0x10}.ready());
  EXPECT_FALSE(Status{0x18}.ready());
  EXPECT_TRUE(Status{0x04}.overrun());
  EXPECT_TRUE(Status{0x100}.overrun());
  EXPECT_TRUE(Status{0x80}.hardware_error());
}

std::vector<std::byte> stream_of(const ScanLayout& layout, std::size_t scans) {
  std::vector<std::byte> bytes;
  for (std::size_t s = 0; s < scans; ++s) {
    for (std::size_t c = 0; c < layout.count; ++c) {
      // only one channel steps by 280
      const std::uint64_t value = 1'000'000 * c + (300 - 10 * c) * s;
      for (std::size_t b = 0; b < bytes_of(layout.width); ++b)
        bytes.push_back(static_cast<std::byte>(value >> 8 * b));
    }
  }
  return bytes;
}

TEST(Quad08Stream, DecodesTheSameHoweverThePacketsAreCut) {
  for (const auto width : {CountWidth::Bits32, CountWidth::Bits48}) {
    const auto layout = layout_of({0, 2, 5}, width);
    const auto bytes = stream_of(layout, 200);
    std::mt19937 random{8};
    ScanDecoder decoder{layout};
    std::size_t scans = 0;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto n = std::min<std::size_t>(1 + random() % 70, bytes.size() - at);
      decoder.push(std::span{bytes}.subspan(at, n));
      at += n;
      while (const auto scan = decoder.next()) {
        EXPECT_EQ((*scan)[0], 300 * scans);
        EXPECT_EQ((*scan)[2], 2'000'000 + 280 * scans);
        ++scans;
      }
    }
    EXPECT_EQ(scans, 200u);
  }
}

TEST(Quad08Stream, UnwrapsBothWidthsInBothDirections) {
  EXPECT_EQ(signed_step(0xFFFFFFFF, 1, CountWidth::Bits32), 2);
  EXPECT_EQ(signed_step(1, 0xFFFFFFFF, CountWidth::Bits32), -2);
  EXPECT_EQ(signed_step(0xFFFFFFFFFFFF, 1, CountWidth::Bits48), 2);
  EXPECT_EQ(signed_step(5, 0xFFFFFFFFFFFF, CountWidth::Bits48), -6);
  EXPECT_EQ(upward_step(0xFFFFFF00, 0x10, CountWidth::Bits32), 0x110u);
}

TEST(Quad08Stream, FindsTheBeginningOfAScanByItsClock) {
  const auto layout = layout_of({0, 1, 5, 6});
  const auto bytes = stream_of(layout, 8);
  const Metronome clock{.place = 2, .step = 280.0};
  for (std::size_t cut = 0; cut < 2 * layout.scan_bytes(); ++cut) {
    const auto window = std::span{bytes}.subspan(cut, seek_window(layout));
    const auto found = seek_scan(window, layout, clock);
    ASSERT_TRUE(found) << cut;
    EXPECT_EQ((cut + *found) % layout.scan_bytes(), 0u);
  }
}

TEST(Quad08Stream, FindsNothingInBytesWithoutTheClock) {
  const auto layout = layout_of({0, 5});
  const std::vector<std::byte> zeros(100);
  EXPECT_FALSE(seek_scan(zeros, layout, Metronome{.place = 1, .step = 300.0}));
}

}  // namespace
}  // namespace abbe::protocol::quad08
