// A stranger without keys that is matched as any participant and sends valid RTPS in random order:
// no subscriber ends or takes all memory, and each applies the model afterwards.
#include <signal.h>
#include <sys/wait.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

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

/// A subscriber that keeps to its limits needs less, however long it runs. AddressSanitizer keeps
/// 256 MB that were freed, and needs memory of its own.
#if defined(__SANITIZE_ADDRESS__)
#define ABBE_ADDRESS_SANITIZER
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ABBE_ADDRESS_SANITIZER
#endif
#endif
#ifdef ABBE_ADDRESS_SANITIZER
constexpr long kMostResident_MB = 1024;
#else
constexpr long kMostResident_MB = 512;
#endif

/// The most memory that the process had at any time.
long peak_resident_MB(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with("VmHWM:")) return std::stol(line.substr(6)) / 1024;
  return -1;
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
  ~HostilePeer() override {
    if (const auto line = python.wait_for("watching", {}, 1s))
      ::kill(std::stoi(line->text.substr(9)), SIGKILL);
  }
  void SetUp() override {
    start_feeder();
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V")) << subscriber->transcript();
    ASSERT_TRUE(linuxcnc.wait_for("usable otf-2024-06-01")) << linuxcnc.transcript();
    ASSERT_TRUE(python.wait_for("apply")) << python.transcript();
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
    for (const Process* subscriber : {&fast, &cyclone, &linuxcnc, &watcher, &python})
      EXPECT_TRUE(runs(*subscriber)) << "seed " << seed();
    EXPECT_TRUE(runs(*feeder_));
    for (const auto& [name, pid] : {std::pair{"abbe-dds", abbe_dds_pid()},
                                    {"abbe-watch", watcher.pid()},
                                    {"LinuxCNC feeder", linuxcnc.pid()},
                                    {"Python", python.pid()},
                                    {"Fast DDS example", fast.pid()},
                                    {"Cyclone DDS example", cyclone.pid()}}) {
      const long peak_MB = peak_resident_MB(pid);
      std::printf("figure: peak resident memory of %s: %ld MB\n", name, peak_MB);
      EXPECT_GT(peak_MB, 0) << name;
      EXPECT_LT(peak_MB, kMostResident_MB) << name << "; seed " << seed();
    }
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
  Process python{{ABBE_PYTHON_FOR_TESTS, ABBE_DECISIONS_SCRIPT, ABBE_PYTHON_SOURCE,
                  ABBE_WATCH_PROGRAM, domain_.text(), ABBE_LOOPBACK_PROFILE}};
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

/// Fast DDS would keep 30,000 numbers of each message, and count to the heartbeat for hours.
TEST_F(HostilePeer, ThatSendsFarNumbersNeitherTakesAllMemoryNorStopsASubscriber) {
  expect_nothing_ends({ABBE_HOSTILE_PEER, domain_.text(), seed(), "numbers"}, 6s);
}

}  // namespace
}  // namespace abbe::test
