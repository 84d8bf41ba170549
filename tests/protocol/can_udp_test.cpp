#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace abbe::protocol::can {
namespace {

std::vector<std::byte> bytes(std::initializer_list<int> values) {
  std::vector<std::byte> out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}
std::vector<std::byte> encode(const std::vector<CanFrame>& frames, std::uint8_t sequence = 0) {
  std::array<std::byte, 65536> buffer{};
  DatagramWriter writer{buffer, sequence};
  for (const auto& frame : frames) EXPECT_TRUE(writer.add(frame));
  const auto datagram = writer.finish();
  return {datagram.begin(), datagram.end()};
}
std::vector<CanFrame> decode(const std::vector<std::byte>& datagram) {
  std::vector<CanFrame> frames;
  auto view = DatagramView::parse(datagram);
  EXPECT_TRUE(view.has_value());
  CanFrame frame;
  while (view && view->next(frame)) frames.push_back(frame);
  return frames;
}
DatagramError error_of(const std::vector<std::byte>& datagram) {
  const auto view = DatagramView::parse(datagram);
  EXPECT_FALSE(view.has_value());
  return view ? DatagramError{} : view.error();
}
CanFrame random_frame(std::mt19937& random) {
  const auto draw = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
  CanFrame frame;
  if (draw(2) != 0) frame.set(FrameFlag::Extended);
  const bool fd = draw(2) != 0;

  if (fd) {
    frame.set(FrameFlag::Fd);
    frame.fd_flags = static_cast<std::uint8_t>(draw(4));
  } else if (draw(4) == 0) {
    frame.set(FrameFlag::Remote);
  }

  frame.id = static_cast<std::uint32_t>(random()) &
             (frame.is(FrameFlag::Extended) ? CanFrame::kExtendedMask : CanFrame::kStandardMask);
  frame.length = static_cast<std::uint8_t>(draw(fd ? 65 : 9));
  for (std::size_t i = 0; i < frame.payload().size(); ++i)
    frame.data[i] = static_cast<std::byte>(draw(256));

  return frame;
}

TEST(CanUdp, HasAHeaderOfFiveBytesAndBigEndianIdentifiers) {
  EXPECT_EQ(encode({standard_frame(0x185, {1, 2, 3, 4})}, 9),
            bytes({2, 0, 9, 0, 1, 0, 0, 1, 0x85, 4, 1, 2, 3, 4}));
}

TEST(CanUdp, MarksExtendedRemoteErrorAndFdFrames) {
  auto extended = standard_frame(0, {});
  extended.set(FrameFlag::Extended);
  extended.id = 0x01020304;
  auto remote = standard_frame(0x123, {0, 0});
  remote.set(FrameFlag::Remote);
  CanFrame error;
  error.set(FrameFlag::Error);
  error.id = 0x40;
  CanFrame fd;
  fd.set(FrameFlag::Fd);
  fd.id = 0x7F;
  fd.fd_flags = 1;
  fd.length = 1;
  fd.data[0] = std::byte{0xAA};
  const auto datagram = encode({extended, remote, error, fd});

  EXPECT_EQ(datagram, bytes({2,    0, 0, 0,    4,  //
                             0x81, 2, 3, 4,    0,  //
                             0x40, 0, 1, 0x23, 2,  //
                             0x20, 0, 0, 0x40, 0,  //
                             0,    0, 0, 0x7F, 0x81, 0x01, 0xAA}));
  EXPECT_EQ(decode(datagram), (std::vector{extended, remote, error, fd}));
}

TEST(CanUdp, AnEmptyDatagramIsValid) {
  EXPECT_EQ(encode({}, 3), bytes({2, 0, 3, 0, 0}));
  EXPECT_TRUE(decode(bytes({2, 0, 3, 0, 0})).empty());
}

TEST(CanUdp, CountsMoreThan255FramesInTwoBytes) {
  const std::vector<CanFrame> frames(300, encode_sync());
  const auto datagram = encode(frames);
  EXPECT_EQ(datagram[3], std::byte{1});
  EXPECT_EQ(datagram[4], std::byte{44});
  EXPECT_EQ(decode(datagram).size(), 300u);
}

TEST(CanUdp, RoundTripsAnyFrames) {
  std::mt19937 random{20240501};
  for (int round = 0; round < 200; ++round) {
    std::vector<CanFrame> frames;
    for (unsigned i = 0; i < random() % 20; ++i) frames.push_back(random_frame(random));
    EXPECT_EQ(decode(encode(frames)), frames) << "round " << round;
  }
}

TEST(CanUdp, RefusesADatagramCutAtAnyByte) {
  std::mt19937 random{7};
  std::vector<CanFrame> frames;
  for (int i = 0; i < 12; ++i) frames.push_back(random_frame(random));
  const auto whole = encode(frames);
  for (std::size_t n = 0; n < whole.size(); ++n) {
    const auto expected = n < kDatagramHeader ? DatagramError::TooShort : DatagramError::Truncated;
    EXPECT_EQ(error_of({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)}), expected)
        << n;
  }
}

TEST(CanUdp, RefusesACountThatDoesNotMatch) {
  auto datagram = encode({encode_sync(), encode_sync()});
  datagram[4] = std::byte{3};
  EXPECT_EQ(error_of(datagram), DatagramError::Truncated);
  datagram[4] = std::byte{1};
  EXPECT_EQ(error_of(datagram), DatagramError::TrailingBytes);
}

TEST(CanUdp, RefusesForeignVersionsOpcodesLengthsAndIdentifiers) {
  EXPECT_EQ(error_of(bytes({1, 0, 0, 0, 0})), DatagramError::BadVersion);
  EXPECT_EQ(error_of(bytes({2, 1, 0, 0, 0})), DatagramError::BadOpcode);
  EXPECT_EQ(error_of(bytes({2, 0, 0, 0, 1, 0, 0, 0, 1, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0})),
            DatagramError::BadLength);
  EXPECT_EQ(error_of(bytes({2, 0, 0, 0, 1, 0, 0, 0, 1, 0x80 | 65, 0})), DatagramError::BadLength);
  EXPECT_EQ(error_of(bytes({2, 0, 0, 0, 1, 0x40, 0, 0, 1, 0x80, 0})), DatagramError::BadLength);
  EXPECT_EQ(error_of(bytes({2, 0, 0, 0, 1, 0, 0, 0x08, 0, 0})), DatagramError::BadId);
}

TEST(CanUdp, StopsAddingWhenTheBufferIsFull) {
  std::array<std::byte, kDatagramHeader + 12> buffer{};
  DatagramWriter writer{buffer, 0};
  EXPECT_TRUE(writer.add(encode_sync()));
  EXPECT_FALSE(writer.add(standard_frame(0x181, {1, 2, 3, 4})));
  EXPECT_TRUE(writer.add(encode_sync(1)));
  EXPECT_EQ(writer.count(), 2u);
}

TEST(CanUdp, GivesTheLengthOfAFrameInAdvance) {
  std::mt19937 random{11};
  for (int i = 0; i < 100; ++i) {
    const auto frame = random_frame(random);
    EXPECT_EQ(encode({frame}).size(), kDatagramHeader + encoded_size(frame));
  }
}

TEST(SequenceGaps, CountsWhatIsMissingAcrossTheWrap) {
  SequenceGaps gaps;
  EXPECT_EQ(gaps.on_sequence(254), 0u);
  EXPECT_EQ(gaps.on_sequence(255), 0u);
  EXPECT_EQ(gaps.on_sequence(0), 0u);
  EXPECT_EQ(gaps.on_sequence(4), 3u);
  EXPECT_EQ(gaps.lost(), 3u);
}

TEST(SequenceGaps, DistinguishesALateDatagramFromALargeGap) {
  SequenceGaps gaps;
  (void)gaps.on_sequence(10);
  EXPECT_EQ(gaps.on_sequence(12), 1u);
  EXPECT_EQ(gaps.on_sequence(11), 0u);
  EXPECT_EQ(gaps.on_sequence(13), 0u);
  EXPECT_EQ(gaps.late(), 1u);
  EXPECT_EQ(gaps.lost(), 1u);
}

TEST(SequenceGaps, TakesAnyNumberAfterARestart) {
  SequenceGaps gaps;
  (void)gaps.on_sequence(100);
  gaps.restart();
  EXPECT_EQ(gaps.on_sequence(0), 0u);
  EXPECT_EQ(gaps.lost(), 0u);
}

}  // namespace
}  // namespace abbe::protocol::can
