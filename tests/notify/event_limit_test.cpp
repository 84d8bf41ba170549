#include "abbe/notify/event_limit.hpp"

#include <gmock/gmock.h>

namespace abbe::notify {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::chrono::steady_clock::time_point kLimitStart{std::chrono::hours{1}};

Event device(Phase phase, const std::string& subject = "tracker") {
  return {.kind = NotifyKind::DeviceLost,
          .phase = phase,
          .severity = phase == Phase::Begins ? Severity::Fault : Severity::Info,
          .subject = subject,
          .text = subject + (phase == Phase::Begins ? ": connecting" : ": streaming")};
}

EventLimit limit() {
  return {"mill 7", {NotifyKind::DeviceLost, NotifyKind::Drift}, "run"};
}

TEST(EventLimit, SendsTheFirstEventAtOnce) {
  auto events = limit();
  events.add(device(Phase::Begins));
  const auto sent = events.due(kLimitStart);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_EQ(sent[0].kind, "device_lost");
  EXPECT_EQ(sent[0].machine, "mill 7");
  EXPECT_EQ(sent[0].text, "tracker: connecting");
  EXPECT_EQ(sent[0].changes, 1u);
  EXPECT_THAT(events.due(kLimitStart + 10min), IsEmpty());
}

TEST(EventLimit, SendsOneMessageAMinuteOfAStreamThatFlaps) {
  auto events = limit();
  std::vector<Notification> sent;
  for (int second = 0; second <= 120; ++second) {
    events.add(device(second % 2 == 0 ? Phase::Begins : Phase::Ends));
    for (auto& notification : events.due(kLimitStart + std::chrono::seconds{second}))
      sent.push_back(std::move(notification));
  }
  ASSERT_THAT(sent, SizeIs(3));
  EXPECT_EQ(sent[1].changes, 60u);
  EXPECT_EQ(sent[1].text, "tracker: connecting");
  EXPECT_EQ(sent[1].phase, Phase::Begins);
}

TEST(EventLimit, PutsDevicesOfOneKindIntoOneMessage) {
  auto events = limit();
  events.add(device(Phase::Ends, "encoder"));
  events.add(device(Phase::Begins, "tracker"));
  events.add(device(Phase::Ends, "air"));
  const auto sent = events.due(kLimitStart);
  ASSERT_THAT(sent, SizeIs(1));
  EXPECT_THAT(sent[0].subjects, ElementsAre("encoder", "tracker", "air"));
  EXPECT_EQ(sent[0].text, "encoder: streaming; tracker: connecting; air: streaming");
  EXPECT_EQ(sent[0].severity, Severity::Fault);
  EXPECT_EQ(sent[0].phase, Phase::Begins);
}

TEST(EventLimit, DoesNotHoldBackOtherKinds) {
  auto events = limit();
  events.add(device(Phase::Begins));
  EXPECT_THAT(events.due(kLimitStart), SizeIs(1));
  events.add({.kind = NotifyKind::Drift, .subject = "model", .text = "DRIFT"});
  EXPECT_THAT(events.due(kLimitStart + 1s), SizeIs(1));
}

TEST(EventLimit, IgnoresKindsThatAreNotWanted) {
  auto events = limit();
  events.add({.kind = NotifyKind::PersonNeeded, .subject = "x", .text = "x"});
  EXPECT_THAT(events.due(kLimitStart), IsEmpty());
}

TEST(EventLimit, GivesEachNotificationAnIdOfItsOwn) {
  auto events = limit();
  events.add(device(Phase::Begins));
  const auto first = events.due(kLimitStart);
  events.add(device(Phase::Ends));
  const auto second = events.due(kLimitStart + 60s);
  ASSERT_THAT(second, SizeIs(1));
  EXPECT_NE(first[0].id, second[0].id);
  EXPECT_NE(random_run(), random_run());
}

TEST(EventLimit, BoundsTheSubjectsOfAMessage) {
  auto events = limit();
  for (int i = 0; i < 100; ++i) events.add(device(Phase::Begins, std::to_string(i)));
  const auto sent = events.due(kLimitStart);
  EXPECT_THAT(sent[0].subjects, SizeIs(EventLimit::kMostHeld));
  EXPECT_EQ(sent[0].changes, 100u);
}

}  // namespace
}  // namespace abbe::notify
