#include "abbe/drivers/can/pending_sync.hpp"

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

constexpr auto kSyncPeriod = 1ms;
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
  std::vector<Seen> settle(const std::vector<ReceivedFrame>& came, HostTime now,
                           bool all_read = true) {
    out.assign(came.size() + 1, {});
    out.resize(under_way.settle(came, out, now, all_read));
    std::vector<Seen> seen;
    seen.reserve(out.size());
    for (const auto& received : out) {
      EXPECT_EQ(received.echo, can::decode_sync(received.frame).has_value());
      seen.push_back({received.echo, received.time - kStart});
    }
    return seen;
  }

  /// A whole cycle of node 1 before kStart.
  void SetUp() override {
    under_way.sent(kStart - kSyncPeriod);
    (void)settle({echo(kStart - kSyncPeriod), answer(kStart - kSyncPeriod + 200us)},
                 kStart - 100us);
  }

  PendingSync under_way{[] {
    EncoderReceiverOptions options = encoder_line::three_axes();
    options.sync_period = kSyncPeriod;
    options.answer_within = kAnswerWithin;
    return options;
  }()};
  std::vector<ReceivedFrame> out;
};

TEST_F(SyncUnderWayTest, IsSentAtTheTimeOfItsEcho) {
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
  EXPECT_THAT(settle({}, kStart + kAnswerWithin, false), IsEmpty())
      << "it may be behind what was read";
  EXPECT_THAT(settle({}, kStart + kAnswerWithin), ElementsAre(sync(0us)));
  EXPECT_THAT(settle({}, kStart + 2ms), IsEmpty()) << "once";
}

TEST_F(SyncUnderWayTest, DelaysFurtherSyncsUntilItIsSentAndAnswered) {
  under_way.sent(kStart);
  ASSERT_THAT(settle({}, kStart + 1ms), ElementsAre(sync(0us)));
  EXPECT_TRUE(under_way.waits(kStart + 50ms));
  EXPECT_THAT(settle({echo(kStart + 50ms)}, kStart + 50ms), IsEmpty()) << "was counted";
  EXPECT_TRUE(under_way.waits(kStart + 50ms + kSyncPeriod - 1ns));
  EXPECT_FALSE(under_way.waits(kStart + 50ms + kSyncPeriod));
}

TEST_F(SyncUnderWayTest, TimesOutEventually) {
  under_way.sent(kStart);
  EXPECT_TRUE(under_way.waits(kStart + PendingSync::kPatience - 1ns));
  EXPECT_FALSE(under_way.waits(kStart + PendingSync::kPatience));
}

TEST_F(SyncUnderWayTest, CountsFromSendingIfItsAnswerIsReceivedBeforeItsEcho) {
  under_way.sent(kStart);
  EXPECT_THAT(settle({answer(kStart + 200us)}, kStart + 205us),
              ElementsAre(sync(0us), frame(200us)));
  EXPECT_TRUE(out[0].time_widened);
  EXPECT_FALSE(under_way.waits(kStart + 205us)) << "it has left";
  under_way.sent(kStart + kSyncPeriod);
  EXPECT_THAT(settle({echo(kStart + 60us), answer(kStart + 1200us), echo(kStart + 1060us),
                      answer(kStart + 1300us)},
                     kStart + 1310us),
              ElementsAre(sync(1ms), frame(1200us), frame(1300us)))
      << "the echo of the one before is none of this one";
}

TEST_F(SyncUnderWayTest, LateAnswersToThePreviousSyncAndOtherFramesAreIgnored) {
  (void)settle({}, kStart);
  under_way.sent(kStart);
  (void)settle({echo(kStart)}, kStart);  // node 1 does not answer this one in time
  under_way.sent(kStart + kSyncPeriod);
  EXPECT_THAT(settle({answer(kStart + 1010us), heartbeat(kStart + 1020us), echo(kStart + 1060us),
                      answer(kStart + 1200us)},
                     kStart + 1210us),
              ElementsAre(frame(1010us), frame(1020us), sync(1060us), frame(1200us)));
}

TEST_F(SyncUnderWayTest, CountsFromSendingIfTheStampOfItsEchoIsRejected) {
  under_way.sent(kStart);
  auto late = echo(kStart + 5ms);
  late.time_widened = true;
  EXPECT_THAT(settle({late}, kStart + 5ms), ElementsAre(sync(0us)));
  EXPECT_TRUE(out[0].time_widened);
  EXPECT_FALSE(under_way.waits(kStart + 5ms));
}

TEST_F(SyncUnderWayTest, AnEchoWithoutAPendingSyncIsIgnored) {
  EXPECT_THAT(settle({echo(kStart), heartbeat(kStart + 1us)}, kStart + 1ms),
              ElementsAre(frame(1us)));
  under_way.sent(kStart);
  under_way.forget();
  EXPECT_THAT(settle({echo(kStart)}, kStart + 1ms), IsEmpty());
}

/// The receiver behind it.
TEST_F(SyncUnderWayTest, GivesASampleWithAllAxesMissingOfABusThatDoesNotSend) {
  encoder_line::Line line;
  line.cycle(kStart - kSyncPeriod, 100);
  under_way.sent(kStart);
  (void)settle({}, kStart + kAnswerWithin);
  for (const auto& received : out) line.keep(line.receiver.on_sent(received.frame, received.time));
  line.time(kStart + kAnswerWithin);
  ASSERT_EQ(line.samples.size(), 2u);
  EXPECT_EQ(line.samples[1].head.time, kStart);
  EXPECT_EQ(line.samples[1].missing_mask, 0b111);
}

}  // namespace
}  // namespace abbe::drivers
