// Both kinds of subscriber detect a process that ended or hangs within the times of the contract;
// each test prints the time it took. The decision "apply or not" comes from the two example
// subscribers.
#include <signal.h>

#include <cstdio>
#include <fstream>
#include <sstream>
#include <thread>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kActive = "vmc-3: state 1";
constexpr const char* kInvalid = "vmc-3: state 4 SOURCE_LOST";

class DdsLiveness : public ShopFloor {
 protected:
  void SetUp() override {
    start_feeder();
    ASSERT_TRUE(fast.wait_for("vmc-3: apply V")) << fast.transcript();
    ASSERT_TRUE(cyclone.wait_for("vmc-3: apply V")) << cyclone.transcript();
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
  // 500 ms of silence, at most 200 ms since the last assertion, 1 s of lease, and what a busy host
  // adds.
  expect_both("vmc-3: not alive", stopped, 3s);
}

TEST_F(DdsLiveness, BothApplyAgainOnceAbbedSendsAgain) {
  const auto stopped = Clock::now();
  feeder_->signal(SIGSTOP);
  ASSERT_TRUE(fast.wait_for(kInvalid, stopped));
  ASSERT_TRUE(cyclone.wait_for(kInvalid, stopped));
  const auto resumed = Clock::now();
  feeder_->signal(SIGCONT);
  expect_both(kActive, resumed, 3s);
  expect_both("vmc-3: apply V", resumed, 3s);
}

TEST_F(DdsLiveness, SamplesFlowAgainWithinTwoSecondsAfterAbbeDdsWasKilled) {
  const pid_t first = abbe_dds_pid();
  const auto killed = Clock::now();
  ::kill(first, SIGKILL);
  ASSERT_TRUE(feeder_->wait_for("child", killed));
  EXPECT_NE(abbe_dds_pid(), first);
  // What the killed process had sent is read by now.
  const auto in_flight = 50ms;
  expect_both("vmc-3: apply V", killed + in_flight, 2s - in_flight);
}

TEST_F(DdsLiveness, AHungAbbeDdsIsNotTrusted) {
  const pid_t pid = abbe_dds_pid();
  const auto stopped = Clock::now();
  ::kill(pid, SIGSTOP);
  // 1 s of lease and what a busy host adds.
  expect_both("vmc-3: not alive", stopped, 3s);
  ::kill(pid, SIGKILL);
}

/// The lease of a site's profile is shorter than the silence after which the subscriber counts it
/// as lost: Cyclone DDS drops abbe-dds, but abbe-dds does not drop Cyclone DDS.
TEST_F(ShopFloor, CycloneReconnectsToAParticipantItDropped) {
  std::stringstream text;
  text << std::ifstream(ABBE_LOOPBACK_PROFILE).rdbuf();
  const std::string lease = "<leaseDuration><sec>40<";
  std::string profile = text.str();
  ASSERT_NE(profile.find(lease), std::string::npos);
  profile_ = directory_ / "short-lease.xml";
  std::ofstream(profile_) << profile.replace(profile.find(lease), lease.size(),
                                             "<leaseDuration><sec>2<");

  start_feeder();
  Process cyclone(cyclone_subscriber());
  ASSERT_TRUE(cyclone.wait_for("vmc-3: apply V")) << cyclone.transcript();
  ::kill(abbe_dds_pid(), SIGSTOP);
  std::this_thread::sleep_for(3s);  // the lease is over
  ::kill(abbe_dds_pid(), SIGCONT);
  const auto resumed = Clock::now();
  ASSERT_TRUE(cyclone.wait_for("vmc-3: not alive"));
  EXPECT_TRUE(cyclone.wait_for("vmc-3: apply V", resumed, 10s)) << cyclone.transcript();
}

/// vmc-3 and another machine on one domain, seen by all three subscribers.
class DdsTwoMachines : public ShopFloor {
 protected:
  void SetUp() override {
    start_feeder();
    for (Process* subscriber : {&fast, &cyclone}) {
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V")) << subscriber->transcript();
      ASSERT_TRUE(subscriber->wait_for("other: apply V")) << subscriber->transcript();
    }
    for (const char* alive : {"vmc-3  publisher is alive", "other  publisher is alive"})
      ASSERT_TRUE(watching.wait_for(alive)) << watching.transcript();
  }

  std::unique_ptr<Process> other = feeder_of("other");
  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
  Process watching{watch({})};
};

TEST_F(DdsTwoMachines, AnEndedPublisherIsNotKeptAliveByTheOther) {
  const auto killed = Clock::now();
  ::kill(abbe_dds_pid(), SIGSTOP);  // otherwise it would publish INVALID
  feeder_->signal(SIGKILL);
  ::kill(abbe_dds_pid(), SIGKILL);
  for (Process* subscriber : {&fast, &cyclone, &watching}) {
    const auto seen = subscriber->wait_for(
        subscriber == &watching ? "vmc-3  publisher is not alive" : "vmc-3: not alive", killed);
    ASSERT_TRUE(seen.has_value()) << subscriber->transcript();
    std::printf("  not alive after %.0f ms\n", milliseconds(seen->came - killed));
    EXPECT_LE(seen->came - killed, 3s);  // 1 s of lease and what a busy host adds
    EXPECT_TRUE(subscriber->wait_for("other", seen->came)) << subscriber->transcript();
  }
}

}  // namespace
}  // namespace abbe::test
