// A subscriber withdraws "apply" by itself when nothing arrives any more: the Python package,
// abbe-watch and both examples, with publishers that are killed, hang or are cut off. Each test
// prints the time it took.
#include <signal.h>

#include <cstdio>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

/// The validity of the sample vectors is 0.5 s; the rest is what a busy host adds.
constexpr auto kWithinValidity = 2s;

class DdsDecisions : public ShopFloor {
 protected:
  void SetUp() override {
    start_feeder();
    const auto since = Clock::now();
    for (Process* subscriber : {&python, &watching, &fast, &cyclone}) {
      while (!applies(*subscriber) && Clock::now() - since < 20s) std::this_thread::sleep_for(10ms);
      ASSERT_TRUE(applies(*subscriber)) << subscriber->transcript();
    }
  }
  ~DdsDecisions() override {
    if (const auto line = python.wait_for("watching", {}, 1s))
      ::kill(std::stoi(line->text.substr(9)), SIGKILL);
  }

  /// The decision that a line of the subscriber states, nothing if it states another thing.
  [[nodiscard]] std::optional<bool> decision_in(const Process& subscriber,
                                                const std::string& line) const {
    if (line.find("do not apply: ") != std::string::npos) return false;
    const bool apply = &subscriber == &python     ? line == "apply"
                       : &subscriber == &watching ? line.ends_with("  apply")
                                                  : line.starts_with("vmc-3: apply V");
    return apply ? std::optional(true) : std::nullopt;
  }
  [[nodiscard]] bool applies(Process& subscriber) const {
    std::optional<bool> last;
    for (const Line& line : subscriber.lines()) {
      if (const auto decision = decision_in(subscriber, line.text)) last = decision;
    }
    return last == true;
  }
  /// The subscriber does not apply any more at `since` + kWithinValidity. It may have refused
  /// before `since`: on a busy host a vector is sometimes too old, and no further refusal follows.
  void expect_refusal(Process& subscriber, Clock::time_point since) {
    std::this_thread::sleep_until(since + kWithinValidity);
    std::optional<Line> refused;
    for (const Line& line : subscriber.lines()) {
      const auto decision = decision_in(subscriber, line.text);
      if (decision == true) refused.reset();
      if (decision == false && !refused) refused = line;
    }
    ASSERT_TRUE(refused) << subscriber.transcript();
    std::printf("  after %4.0f ms: %s\n", milliseconds(refused->came - since),
                refused->text.c_str());
    EXPECT_LE(milliseconds(refused->came - since), milliseconds(kWithinValidity));
  }
  void expect_refusals(Clock::time_point since) {
    for (Process* subscriber : {&python, &watching, &fast, &cyclone})
      expect_refusal(*subscriber, since);
  }
  pid_t watch_of_python() {
    const auto line = python.wait_for("watching");
    EXPECT_TRUE(line);
    return line ? std::stoi(line->text.substr(9)) : 0;
  }

  Process python{{ABBE_PYTHON_FOR_TESTS, ABBE_DECISIONS_SCRIPT, ABBE_PYTHON_SOURCE,
                  ABBE_WATCH_PROGRAM, domain_.text(), ABBE_LOOPBACK_PROFILE}};
  Process watching{watch({})};
  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
};

TEST_F(DdsDecisions, WhenAbbedIsKilled) {
  const auto killed = Clock::now();
  feeder_->signal(SIGKILL);
  expect_refusals(killed);
}

TEST_F(DdsDecisions, WhenAbbedAndAbbeDdsAreKilled) {
  const pid_t publisher = abbe_dds_pid();
  const auto killed = Clock::now();
  ::kill(publisher, SIGSTOP);  // otherwise it would publish INVALID
  feeder_->signal(SIGKILL);
  ::kill(publisher, SIGKILL);
  expect_refusals(killed);
}

TEST_F(DdsDecisions, WhenAbbedHangs) {
  const auto stopped = Clock::now();
  feeder_->signal(SIGSTOP);
  expect_refusals(stopped);
}

/// Nothing arrives any more, as with a cable that was pulled.
TEST_F(DdsDecisions, WhenAbbeDdsHangs) {
  const pid_t publisher = abbe_dds_pid();
  const auto stopped = Clock::now();
  ::kill(publisher, SIGSTOP);
  expect_refusals(stopped);
  ::kill(publisher, SIGKILL);
}

TEST_F(DdsDecisions, WhenAbbeWatchOfThePythonPackageIsKilled) {
  const auto killed = Clock::now();
  ::kill(watch_of_python(), SIGKILL);
  expect_refusal(python, killed);
}

TEST_F(DdsDecisions, WhenAbbeWatchOfThePythonPackageHangs) {
  const pid_t watch = watch_of_python();
  const auto stopped = Clock::now();
  ::kill(watch, SIGSTOP);
  expect_refusal(python, stopped);
  const auto resumed = Clock::now();
  ::kill(watch, SIGCONT);
  EXPECT_TRUE(python.wait_for("apply", resumed)) << python.transcript();
}

}  // namespace
}  // namespace abbe::test
