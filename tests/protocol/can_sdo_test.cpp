#include <gtest/gtest.h>

#include <array>
#include <numeric>
#include <vector>

#include "abbe/protocol/can/cia406.hpp"
#include "abbe/protocol/can/sdo_client.hpp"
#include "abbe/protocol/can/sdo_server.hpp"

namespace abbe::protocol::can {
namespace {

using namespace std::chrono_literals;

constexpr ObjectId kScratch{0x2000, 0};

std::vector<std::byte> counting_bytes(std::size_t n) {
  std::vector<std::byte> bytes(n);
  for (std::size_t i = 0; i < n; ++i) bytes[i] = static_cast<std::byte>((7 * i + n) & 0xFF);
  return bytes;
}

/// A client and a server with a wire of no length between them.
struct Link {
  EncoderIdentity identity{.node = 5};
  ObjectDictionary objects{identity};
  SdoServer server{5, objects};
  SdoClient client{5};
  HostTime now{};

  void run() {
    while (const auto request = client.take_frame()) {
      if (const auto answer = server.on_frame(*request, now)) client.on_frame(*answer, now);
    }
  }
};

CanFrame answer(std::initializer_list<std::uint8_t> bytes) {
  return standard_frame(0x585, bytes);
}

TEST(SdoClient, ReadsThePositionOfNodeFiveExpedited) {
  SdoClient client{5};
  client.start_upload({0x6004, 0}, HostTime{});
  EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x40, 0x04, 0x60, 0, 0, 0, 0, 0}));
  client.on_frame(answer({0x43, 0x04, 0x60, 0, 0xD0, 0xD1, 0xD2, 0xD3}), HostTime{});
  EXPECT_EQ(client.state(), SdoClient::State::Done);
  EXPECT_EQ(client.number(), 0xD3D2D1D0u);
}

TEST(SdoClient, WritesOneToFourBytesExpedited) {
  const std::array<std::uint8_t, 4> commands{0x2F, 0x2B, 0x27, 0x23};
  for (std::size_t n = 1; n <= 4; ++n) {
    SdoClient client{5};
    client.start_download({0x1017, 0}, counting_bytes(n), HostTime{});
    const auto request = client.take_frame();
    ASSERT_TRUE(request);
    EXPECT_EQ(request->byte(0), commands[n - 1]);
    EXPECT_EQ(request->byte(1), 0x17);
    EXPECT_EQ(request->byte(2), 0x10);
    client.on_frame(answer({0x60, 0x17, 0x10, 0, 0, 0, 0, 0}), HostTime{});
    EXPECT_EQ(client.state(), SdoClient::State::Done);
  }
}

TEST(SdoClient, WritesEightBytesInTwoSegments) {
  SdoClient client{5};
  const std::array value{std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4},
                         std::byte{5}, std::byte{6}, std::byte{7}, std::byte{8}};
  client.start_download({0x6009, 0}, value, HostTime{});
  EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x21, 0x09, 0x60, 0, 8, 0, 0, 0}));
  client.on_frame(answer({0x60, 0x09, 0x60, 0, 0, 0, 0, 0}), HostTime{});
  EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x00, 1, 2, 3, 4, 5, 6, 7}));
  client.on_frame(answer({0x20, 0, 0, 0, 0, 0, 0, 0}), HostTime{});
  EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x1D, 8, 0, 0, 0, 0, 0, 0}));
  client.on_frame(answer({0x30, 0, 0, 0, 0, 0, 0, 0}), HostTime{});
  EXPECT_EQ(client.state(), SdoClient::State::Done);
}

class SdoSize : public testing::TestWithParam<std::size_t> {};

TEST_P(SdoSize, CrossesTheWireInBothDirections) {
  Link link;
  const auto value = counting_bytes(GetParam());
  link.objects.add(kScratch, Access::ReadWrite, {}, true);
  link.client.start_download(kScratch, value, link.now);
  link.run();
  ASSERT_EQ(link.client.state(), SdoClient::State::Done);
  link.client.start_upload(kScratch, link.now);
  link.run();
  ASSERT_EQ(link.client.state(), SdoClient::State::Done);
  EXPECT_TRUE(std::ranges::equal(link.client.value(), value));
}
INSTANTIATE_TEST_SUITE_P(OneToHundred, SdoSize, testing::Range<std::size_t>(1, 101));

TEST(SdoClient, RefusesEmptyAndOversizedValuesAtOnce) {
  SdoClient client{5};
  for (const std::size_t n : {std::size_t{0}, kMaxSdoBytes + 1}) {
    client.start_download(kScratch, counting_bytes(n), HostTime{});
    EXPECT_EQ(client.state(), SdoClient::State::Failed);
    EXPECT_EQ(client.abort_code(), AbortCode::LengthMismatch);
    EXPECT_FALSE(client.take_frame());
  }
}

TEST(SdoClient, ReportsTheServersAbort) {
  Link link;
  link.client.start_upload({0x7777, 0}, link.now);
  link.run();
  EXPECT_EQ(link.client.state(), SdoClient::State::Failed);
  EXPECT_EQ(link.client.abort_code(), AbortCode::NoObject);
  EXPECT_TRUE(link.client.aborted_by_server());
}

TEST(SdoClient, AbortsAndRetriesTwiceWhenTheServerIsMute) {
  SdoClient client{5};
  HostTime now{};
  client.start_upload(object::kDeviceType, now);
  const auto request = client.take_frame();

  for (int attempt = 0; attempt < 2; ++attempt) {
    client.on_time(now + 499ms);
    EXPECT_FALSE(client.take_frame());
    now += 500ms;
    client.on_time(now);
    EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x80, 0x00, 0x10, 0, 0, 0, 0x04, 0x05}));
    EXPECT_EQ(client.take_frame(), request);
  }

  client.on_time(now + 500ms);
  EXPECT_EQ(client.state(), SdoClient::State::Failed);
  EXPECT_EQ(client.abort_code(), AbortCode::Timeout);
  EXPECT_FALSE(client.aborted_by_server());
}

TEST(SdoClient, FinishesWhenTheAnswerComesAfterARetry) {
  Link link;
  link.client.start_upload(object::kDeviceType, link.now);
  EXPECT_TRUE(link.client.take_frame());  // lost on the way
  link.now += 500ms;
  link.client.on_time(link.now);
  link.run();
  EXPECT_EQ(link.client.state(), SdoClient::State::Done);
  EXPECT_EQ(link.client.number(), 0x00080196u);
}

TEST(SdoClient, EachSegmentGetsItsOwnTimeOut) {
  Link link;
  link.client.start_upload(object::kDeviceName, link.now);
  while (link.client.state() == SdoClient::State::Busy) {
    link.now += 400ms;
    const auto request = link.client.take_frame();
    ASSERT_TRUE(request);
    link.client.on_time(link.now);
    link.client.on_frame(*link.server.on_frame(*request, link.now), link.now);
  }
  EXPECT_EQ(link.client.state(), SdoClient::State::Done);
}

TEST(SdoClient, AbortsAnUploadWhoseToggleDoesNotChange) {
  SdoClient client{5};
  client.start_upload(object::kDeviceName, HostTime{});
  client.on_frame(answer({0x41, 0x08, 0x10, 0, 20, 0, 0, 0}), HostTime{});
  client.on_frame(answer({0x00, 1, 2, 3, 4, 5, 6, 7}), HostTime{});
  while (client.take_frame()) {
  }
  client.on_frame(answer({0x00, 1, 2, 3, 4, 5, 6, 7}), HostTime{});
  EXPECT_EQ(client.abort_code(), AbortCode::ToggleBit);
  EXPECT_EQ(client.take_frame(), standard_frame(0x605, {0x80, 0x08, 0x10, 0, 0, 0, 0x03, 0x05}));
}

TEST(SdoClient, AbortsADownloadWhoseToggleIsWrong) {
  SdoClient client{5};
  client.start_download(kScratch, counting_bytes(20), HostTime{});
  client.on_frame(answer({0x60, 0x00, 0x20, 0, 0, 0, 0, 0}), HostTime{});
  client.on_frame(answer({0x30, 0, 0, 0, 0, 0, 0, 0}), HostTime{});
  EXPECT_EQ(client.state(), SdoClient::State::Failed);
  EXPECT_EQ(client.abort_code(), AbortCode::ToggleBit);
}

TEST(SdoClient, RefusesMoreBytesThanItHoldsAndWrongSizes) {
  SdoClient client{5};
  client.start_upload(kScratch, HostTime{});
  client.on_frame(answer({0x41, 0x00, 0x20, 0, 0xFF, 0xFF, 0, 0}), HostTime{});
  EXPECT_EQ(client.abort_code(), AbortCode::OutOfMemory);
  client.start_upload(kScratch, HostTime{});
  client.on_frame(answer({0x41, 0x00, 0x20, 0, 9, 0, 0, 0}), HostTime{});
  client.on_frame(answer({0x01, 1, 2, 3, 4, 5, 6, 7}), HostTime{});
  EXPECT_EQ(client.abort_code(), AbortCode::LengthMismatch);
}

TEST(SdoClient, StopsAnEndlessUploadOfUnknownSize) {
  SdoClient client{5};
  client.start_upload(kScratch, HostTime{});
  client.on_frame(answer({0x40, 0x00, 0x20, 0, 0, 0, 0, 0}), HostTime{});
  for (int i = 0; i < 100; ++i) {
    client.on_frame(
        answer({static_cast<std::uint8_t>(i % 2 == 0 ? 0x00 : 0x10), 1, 2, 3, 4, 5, 6, 7}),
        HostTime{});
  }
  EXPECT_EQ(client.abort_code(), AbortCode::OutOfMemory);
}

TEST(SdoClient, IgnoresAnswersToOtherRequests) {
  SdoClient client{5};
  client.start_upload({0x6004, 0}, HostTime{});
  client.on_frame(answer({0x43, 0x05, 0x60, 1, 1, 0, 0, 0}), HostTime{});  // another object
  client.on_frame(answer({0x80, 0x05, 0x60, 1, 0, 0, 2, 6}), HostTime{});  // another abort
  client.on_frame(standard_frame(0x586, {0x43, 0x04, 0x60, 0, 1, 0, 0, 0}),
                  HostTime{});                                    // another node
  client.on_frame(answer({0x43, 0x04, 0x60, 0, 1}), HostTime{});  // a torn frame
  EXPECT_EQ(client.state(), SdoClient::State::Busy);
}

TEST(SdoServer, AnswersWithTheExampleBytes) {
  Link link;
  link.objects.set_raw_position(0x03020100);
  const auto request = standard_frame(0x605, {0x40, 0x04, 0x60, 0, 0, 0, 0, 0});
  EXPECT_EQ(link.server.on_frame(request, link.now), answer({0x43, 0x04, 0x60, 0, 0, 1, 2, 3}));
}

TEST(SdoServer, AbortsSegmentsWithoutATransfer) {
  Link link;
  for (const std::uint8_t command : {std::uint8_t{0x60}, std::uint8_t{0x00}}) {
    const auto reply =
        link.server.on_frame(standard_frame(0x605, {command, 0, 0, 0, 0, 0, 0, 0}), link.now);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->byte(0), 0x80);
    EXPECT_EQ(reply->byte(7), 0x05);
    EXPECT_EQ(reply->byte(4), 0x01);
  }
}

TEST(SdoServer, AbortsARepeatedToggle) {
  Link link;
  (void)link.server.on_frame(standard_frame(0x605, {0x40, 0x08, 0x10, 0, 0, 0, 0, 0}), link.now);
  const auto segment = standard_frame(0x605, {0x60, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(link.server.on_frame(segment, link.now)->byte(0) & 0xE0, 0x00);
  EXPECT_EQ(link.server.on_frame(segment, link.now),
            answer({0x80, 0x08, 0x10, 0, 0, 0, 0x03, 0x05}));
}

TEST(SdoServer, AbortsATransferTheClientAbandoned) {
  Link link;
  (void)link.server.on_frame(standard_frame(0x605, {0x40, 0x08, 0x10, 0, 0, 0, 0, 0}), link.now);
  EXPECT_FALSE(link.server.on_time(link.now + 499ms));
  EXPECT_EQ(link.server.on_time(link.now + 500ms), answer({0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05}));
  EXPECT_FALSE(link.server.on_time(link.now + 600ms));
}

TEST(SdoServer, IgnoresOtherNodesAndTornFrames) {
  Link link;
  EXPECT_FALSE(link.server.on_frame(standard_frame(0x606, {0x40, 0, 0, 0, 0, 0, 0, 0}), link.now));
  EXPECT_FALSE(link.server.on_frame(standard_frame(0x605, {0x40, 0, 0}), link.now));
}

TEST(AbortCode, HasATextForKnownAndUnknownCodes) {
  EXPECT_STREQ(to_text(AbortCode::NoObject), "object does not exist");
  EXPECT_STREQ(to_text(AbortCode{0xDEADBEEF}), "unknown abort code");
}

}  // namespace
}  // namespace abbe::protocol::can
