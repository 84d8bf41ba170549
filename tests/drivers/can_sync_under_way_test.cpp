#include "abbe/drivers/can/sync_under_way.hpp"

#include <gmock/gmock.h>

#include <vector>

#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using encoder_line::kStart;
using protocol::HostTime;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr auto kAnswerWithin = 800us;

ReceivedFrame echo(HostTime at) {
  return {.frame = can::encode_sync(), .time = at, .echo = true};
}
ReceivedFrame answer(HostTime at) {
  return {.frame = encoder_line::position(1, 7), .time = at};
}
ReceivedFrame heartbeat(HostTime at) {
  return {.frame = can::encode_heartbeat(1, can::NodeState::Operational), .time = at};
}

/// What the receiver is to see: "sync" and "frame" with their times after the start.
struct Seen {
  bool sync = false;
  std::chrono::nanoseconds at{};
  friend bool operator==(const Seen&, const Seen&) = default;
  friend void PrintTo(const Seen& seen, std::ostream* out) {
    *out << (seen.sync ? "sync" : "frame") << " at " << seen.at.count() << " ns";
  }
};
Seen sync(std::chrono::nanoseconds at) {
  return {true, at};
}
Seen frame(std::chrono::nanoseconds at) {
  return {false, at};
}

class SyncUnderWayTest : public testing::Test {
 protected:
  std::vector<Seen> settle(const std::vector<ReceivedFrame>& came, HostTime now) {
    std::vector<ReceivedFrame> out(came.size() + 1);
    out.resize(under_way.settle(came, out, now));
    std::vector<Seen> seen;
    seen.reserve(out.size());
    for (const auto& received : out) {
      EXPECT_EQ(received.echo, can::decode_sync(received.frame).has_value());
      seen.push_back({received.echo, received.time - kStart});
    }
    return seen;
  }

  SyncUnderWay under_way{kAnswerWithin};
};

TEST_F(SyncUnderWayTest, LeavesWhenItsEchoSays) {
  under_way.sent(kStart);
  EXPECT_EQ(under_way.deadline(), kStart + kAnswerWithin);
  EXPECT_TRUE(under_way.waits(kStart + 1ms));
  EXPECT_THAT(settle({echo(kStart + 60us), answer(kStart + 200us)}, kStart + 210us),
              ElementsAre(sync(60us), frame(200us)));
  EXPECT_FALSE(under_way.waits(kStart + 1ms));
  EXPECT_EQ(under_way.deadline(), HostTime::max());
}

TEST_F(SyncUnderWayTest, WithoutAnEchoCountsFromSendingWhenTheAnswersShouldHaveCome) {
  under_way.sent(kStart);
  EXPECT_THAT(settle({}, kStart + kAnswerWithin - 1ns), IsEmpty());
  EXPECT_THAT(settle({}, kStart + kAnswerWithin), ElementsAre(sync(0us)));
  EXPECT_THAT(settle({}, kStart + 2ms), IsEmpty()) << "once";
}

TEST_F(SyncUnderWayTest, KeepsOthersBackUntilItsEchoComesHoweverLate) {
  under_way.sent(kStart);
  ASSERT_THAT(settle({}, kStart + 1ms), ElementsAre(sync(0us)));
  EXPECT_TRUE(under_way.waits(kStart + 50ms));
  EXPECT_THAT(settle({echo(kStart + 50ms)}, kStart + 50ms), IsEmpty()) << "was counted";
  EXPECT_FALSE(under_way.waits(kStart + 50ms));
}

TEST_F(SyncUnderWayTest, IsGivenUpInTheEnd) {
  under_way.sent(kStart);
  EXPECT_FALSE(under_way.waits(kStart + SyncUnderWay::kPatience));
}

TEST_F(SyncUnderWayTest, CountsFromSendingWhereAnAnswerIsToldFirst) {
  under_way.sent(kStart);
  EXPECT_THAT(settle({answer(kStart + 200us), echo(kStart + 210us), answer(kStart + 300us)}, kStart + 310us),
              ElementsAre(sync(0us), frame(200us), frame(300us)));
  EXPECT_FALSE(under_way.waits(kStart + 310us));
}

TEST_F(SyncUnderWayTest, AnswersToTheOneBeforeAndOtherFramesSayNothingOfIt) {
  under_way.sent(kStart);
  EXPECT_THAT(settle({answer(kStart - 10us), heartbeat(kStart + 20us), echo(kStart + 60us)}, kStart + 70us),
              ElementsAre(frame(-10us), frame(20us), sync(60us)));
}

TEST_F(SyncUnderWayTest, AnEchoOfNoneIsNone) {
  EXPECT_THAT(settle({echo(kStart), heartbeat(kStart + 1us)}, kStart + 1ms), ElementsAre(frame(1us)));
  under_way.sent(kStart);
  under_way.forget();
  EXPECT_THAT(settle({echo(kStart)}, kStart + 1ms), IsEmpty());
}

TEST_F(SyncUnderWayTest, WhatIsSeenOfABusThatDoesNotSendIsASampleWithAllAxesMissing) {
  encoder_line::Line line;
  line.cycle(kStart - 1ms, 100);
  under_way.sent(kStart);
  ASSERT_THAT(settle({}, kStart + kAnswerWithin), ElementsAre(sync(0us)));
  line.sync(kStart);
  line.time(kStart + kAnswerWithin);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].head.time, kStart);
  EXPECT_EQ(line.samples[1].missing_mask, 0b111);
}

}  // namespace
}  // namespace abbe::drivers
