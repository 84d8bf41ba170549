// Who dies or hangs is noticed, by both kinds of subscriber, in the times the contract states; each test
// prints what it took. The decision "apply or not" comes from the two example subscribers.
#include <signal.h>

#include <cstdio>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kActive = "state 1";
constexpr const char* kInvalid = "state 4 SOURCE_LOST";

double milliseconds(Clock::duration d) {
  return std::chrono::duration<double, std::milli>(d).count();
}

class DdsLiveness : public ShopFloor {
 protected:
  void SetUp() override {
    start_feeder();
    ASSERT_TRUE(fast.wait_for("apply V")) << fast.transcript();
    ASSERT_TRUE(cyclone.wait_for("apply V")) << cyclone.transcript();
  }

  /// Both subscribers print `line` after `since`, within `limit`.
  void expect_both(const char* line, Clock::time_point since, Clock::duration limit) {
    for (Process* subscriber : {&fast, &cyclone}) {
      const char* name = subscriber == &fast ? "Fast DDS" : "Cyclone DDS";
      const auto seen = subscriber->wait_for(line, since);
      ASSERT_TRUE(seen.has_value()) << name << "\n" << subscriber->transcript();
      std::printf("  %s: \"%s\" after %.0f ms\n", name, line, milliseconds(seen->came - since));
      EXPECT_LE(milliseconds(seen->came - since), milliseconds(limit)) << name;
    }
  }

  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
};

TEST_F(DdsLiveness, BothSeeInvalidWithinASecondWhenAbbedIsKilled) {
  const auto killed = Clock::now();
  feeder_->signal(SIGKILL);
  expect_both(kInvalid, killed, 1s);
}

TEST_F(DdsLiveness, BothSeeInvalidWithinASecondWhenAbbedHangs) {
  const auto stopped = Clock::now();
  feeder_->signal(SIGSTOP);
  expect_both(kInvalid, stopped, 1s);
}

TEST_F(DdsLiveness, TheWriterOfTheStateIsNoLongerAliveWhenAbbedHangs) {
  const auto stopped = Clock::now();
  feeder_->signal(SIGSTOP);
  // 500 ms of silence, at most 200 ms since the last assertion, 1 s of lease, and what a busy host adds.
  expect_both("answered_for 0", stopped, 3s);
}

TEST_F(DdsLiveness, BothApplyAgainOnceAbbedTalksAgain) {
  const auto stopped = Clock::now();
  feeder_->signal(SIGSTOP);
  ASSERT_TRUE(fast.wait_for(kInvalid, stopped));
  ASSERT_TRUE(cyclone.wait_for(kInvalid, stopped));
  const auto resumed = Clock::now();
  feeder_->signal(SIGCONT);
  expect_both(kActive, resumed, 3s);
  expect_both("apply V", resumed, 3s);
}

TEST_F(DdsLiveness, SamplesFlowAgainWithinTwoSecondsAfterAbbeDdsWasKilled) {
  const pid_t first = abbe_dds_pid();
  const auto killed = Clock::now();
  ::kill(first, SIGKILL);
  ASSERT_TRUE(feeder_->wait_for("child", killed));
  EXPECT_NE(abbe_dds_pid(), first);
  // What the killed process had sent is read by now.
  const auto in_flight = 50ms;
  expect_both("apply V", killed + in_flight, 2s - in_flight);
}

TEST_F(DdsLiveness, AHungAbbeDdsIsNotTrusted) {
  const pid_t pid = abbe_dds_pid();
  const auto stopped = Clock::now();
  ::kill(pid, SIGSTOP);
  // 1 s of lease and what a busy host adds.
  expect_both("answered_for 0", stopped, 3s);
  ::kill(pid, SIGKILL);
}

}  // namespace
}  // namespace abbe::test
