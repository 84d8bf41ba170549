// A stranger without keys that is matched as any participant and sends valid RTPS in random order:
// no subscriber ends, and each applies the model afterwards.
#include <signal.h>
#include <sys/wait.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

/// `scripts/soak hostile` asks for more, and for other seeds.
std::chrono::seconds hostile_seconds() {
  const char* const asked = std::getenv("ABBE_HOSTILE_SECONDS");
  return std::chrono::seconds{asked != nullptr ? std::atoi(asked) : 6};
}
std::string seed() {
  const char* const asked = std::getenv("ABBE_HOSTILE_SEED");
  return asked != nullptr ? asked : "20261128";
}

/// The process has neither ended nor become a zombie.
bool runs(const Process& process) {
  siginfo_t info{};
  return ::waitid(P_PID, static_cast<id_t>(process.pid()), &info, WEXITED | WNOHANG | WNOWAIT) ==
             0 &&
         info.si_pid == 0;
}

class HostilePeer : public ShopFloor {
 protected:
  void SetUp() override {
    start_feeder();
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V")) << subscriber->transcript();
    ASSERT_TRUE(linuxcnc.wait_for("usable otf-2024-06-01")) << linuxcnc.transcript();
    ASSERT_TRUE(watcher_applies_again());
  }
  /// A line of `abbe watch --json`, as a program reads it.
  void read(const Line& line) {
    const auto json = nlohmann::json::parse(line.text, nullptr, false);
    if (json.is_discarded()) ++malformed;
    if (!json.is_object()) return;
    if (json.value("machine", "").starts_with("hostile-")) ++heard;
    const auto decision = json.find("decision");
    if (decision != json.end() && json.value("machine", "") == kMachine &&
        decision->value("apply", false))
      ++applied;
  }
  bool watcher_applies_again() {
    const auto before = applied.load();
    for (const auto end = Clock::now() + 20s; Clock::now() < end && applied == before;)
      std::this_thread::sleep_for(10ms);
    return applied > before;
  }

  /// While `command` runs for `duration`, and afterwards.
  void expect_nothing_ends(const std::vector<std::string>& command, std::chrono::seconds duration) {
    {
      Process hostile(command);
      ASSERT_TRUE(hostile.wait_for("started"));
      EXPECT_FALSE(feeder_->wait_for("child", Clock::now(), duration))
          << "abbe-dds was started again; seed " << seed();
      EXPECT_TRUE(runs(hostile));
      std::printf(
          "figure: hostile RTPS for %lld s, seed %s: %s messages; abbe-watch printed %ld "
          "lines of its machines\n",
          static_cast<long long>(duration.count()), seed().c_str(),
          hostile.lines().back().text.c_str(), heard.load());
    }
    for (const Process* subscriber : {&fast, &cyclone, &linuxcnc, &watcher})
      EXPECT_TRUE(runs(*subscriber)) << "seed " << seed();
    EXPECT_TRUE(runs(*feeder_));
    EXPECT_EQ(malformed, 0);

    for (Process* subscriber : {&fast, &cyclone})
      EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", Clock::now())) << "seed " << seed();
    EXPECT_TRUE(watcher_applies_again());
    Process late({ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine});
    EXPECT_TRUE(late.wait_for("usable otf-2024-06-01")) << late.transcript();
  }

  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
  Process linuxcnc{{ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine}};
  std::atomic<long> malformed{0}, applied{0}, heard{0};
  Process watcher{watch({"--json"}), [this](const Line& line) { read(line); }};
};

TEST_F(HostilePeer, EndsNoSubscriberAndEachAppliesTheModelAfterwards) {
  expect_nothing_ends({ABBE_HOSTILE_PEER, domain_.text(), seed()}, hostile_seconds());
  EXPECT_GT(heard, 0) << "the hostile participant was not matched";
}

TEST_F(HostilePeer, ThatOnlyDisposesInstancesEndsNoSubscriber) {
  expect_nothing_ends({ABBE_HOSTILE_PEER, domain_.text(), seed(), "dispose"}, 3s);
}

}  // namespace
}  // namespace abbe::test
