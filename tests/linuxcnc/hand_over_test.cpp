// SPDX-License-Identifier: GPL-2.0-or-later
// The shared memory between the realtime component and the feeder for LinuxCNC, with real processes
// and threads.
#include "hand_over.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/shm.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "control_link.hpp"
#include "latest_usable.hpp"
#include "restarted.hpp"

namespace abbe::linuxcnc {
namespace {

using namespace std::chrono_literals;

/// The memory of a realtime component, with a key that no other test uses.
class HandOver : public testing::Test {
 protected:
  HandOver() {
    segment_ = ::shmget(key_, ABBE_HAND_OVER_SIZE, IPC_CREAT | IPC_EXCL | 0600);
    memory_ = new (::shmat(segment_, nullptr, 0)) abbe_hand_over{};
    memory_->version = ABBE_HAND_OVER_VERSION;
  }
  ~HandOver() override {
    ::shmdt(memory_);
    ::shmctl(segment_, IPC_RMID, nullptr);
  }

  /// A feeder in a process of its own, which writes c = (k, k, k) for k = 1, 2, ... until it is
  /// killed. Returns when it writes.
  pid_t start_feeder() {
    const auto before = number();
    const pid_t child = ::fork();
    if (child == 0) feed_until_killed();
    while (number() == before && ::waitpid(child, nullptr, WNOHANG) == 0) std::this_thread::yield();
    EXPECT_NE(number(), before) << "the feeder has ended";
    return child;
  }
  static void kill_and_wait(pid_t child) {
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
  }
  [[nodiscard]] std::uint32_t number() const {
    return __atomic_load_n(&memory_->wanted_sequence.end, __ATOMIC_ACQUIRE);
  }

  const int key_ = 0x54000000 + ::getpid();
  int segment_ = -1;
  abbe_hand_over* memory_ = nullptr;

 private:
  [[noreturn]] void feed_until_killed() const {
    std::string error;
    auto link = ControlLink::attach(key_, error);
    if (!link) ::_exit(1);
    abbe_wanted wanted{};
    for (double k = 1.0;; k += 1.0) {
      for (double& c : wanted.correction) c = k;
      wanted.valid = 1;
      link->write(wanted);
    }
  }
};

TEST_F(HandOver, NoReadIsTornWhateverKillsTheFeeder) {
  int complete = 0;
  for (int kill = 0; kill < 20; ++kill) {
    const pid_t feeder = start_feeder();
    abbe_wanted w;
    std::uint32_t read_number = 0;
    for (int i = 0; i < 20'000; ++i) {
      if (!abbe_read(&memory_->wanted_sequence, &w, &memory_->wanted, sizeof w, &read_number))
        continue;
      ++complete;
      ASSERT_EQ(w.correction[0], w.correction[1]);
      ASSERT_EQ(w.correction[1], w.correction[2]);
    }
    kill_and_wait(feeder);
  }
  EXPECT_GT(complete, 1000);
}

TEST_F(HandOver, AFeederThatWasKilledIsReplaced) {
  kill_and_wait(start_feeder());
  std::string error;
  const auto next = ControlLink::attach(key_, error);
  EXPECT_TRUE(next) << error;
  EXPECT_EQ(memory_->feeder, ::getpid());
  EXPECT_FALSE(memory_->wanted.valid) << "the values of the feeder before are not used";
}

TEST_F(HandOver, AFeederThatHangsIsReplacedAndEnds) {
  std::string error;
  auto hung = ControlLink::attach(key_, error);
  ASSERT_TRUE(hung) << error;
  EXPECT_EQ(hung->ended(ControlLink::Clock::now()), "");
  kill_and_wait(start_feeder());
  EXPECT_THAT(hung->ended(ControlLink::Clock::now()), testing::HasSubstr("has replaced this one"));
}

TEST_F(HandOver, OneFeederWrites) {
  const pid_t feeder = start_feeder();
  std::string error;
  EXPECT_FALSE(ControlLink::attach(key_, error));
  EXPECT_EQ(error,
            "another abbe-linuxcnc-feeder runs (process " + std::to_string(feeder) + "); end it");
  kill_and_wait(feeder);
}

TEST_F(HandOver, WithoutLinuxCncThereIsAReason) {
  std::string error;
  EXPECT_FALSE(ControlLink::attach(key_ + 1, error));
  EXPECT_THAT(error, testing::HasSubstr("LinuxCNC does not run with abbe_correction"));
  memory_->version = ABBE_HAND_OVER_VERSION + 1;
  EXPECT_FALSE(ControlLink::attach(key_, error));
  EXPECT_THAT(error, testing::HasSubstr("of this version"));
}

TEST_F(HandOver, TheFeederEndsWithLinuxCnc) {
  std::string error;
  auto link = ControlLink::attach(key_, error);
  ASSERT_TRUE(link) << error;
  const auto start = ControlLink::Clock::now();
  EXPECT_EQ(link->ended(start), "");
  EXPECT_EQ(link->ended(start + 60s), "") << "before the first cycle it still loads";

  abbe_control control{};
  control.cycle = 1;
  abbe_write(&memory_->control_sequence, &memory_->control, &control, sizeof control);
  EXPECT_EQ(link->read().cycle, 1u);
  EXPECT_EQ(link->ended(start + 60s), "");
  EXPECT_EQ(link->ended(start + 64s), "");
  EXPECT_EQ(link->ended(start + 1h), "") << "it stands, in a debugger for example";
  memory_->closed = 1;
  EXPECT_EQ(link->ended(start + 1h), "LinuxCNC has ended");
  memory_->closed = 0;
  ::shmdt(std::exchange(memory_, nullptr));  // it was killed
  EXPECT_EQ(link->ended(start + 1h), "LinuxCNC no longer cycles");
}

constexpr std::array<double, 3> kNoOffset{}, kOffset{-20.0, 15.0, 120.0}, kOther{0.0, 0.0, 150.0};

TEST(ToolWatch, AfterAToolChangeTheOffsetIsMissingUntilItChanges) {
  abbe_tool_watch watch{};
  EXPECT_EQ(abbe_watch_tool(&watch, true, 0, kNoOffset.data()), ABBE_TOOL_KNOWN);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 1, kNoOffset.data()), ABBE_TOOL_OFFSET_MISSING);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 1, kOffset.data()), ABBE_TOOL_KNOWN);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 2, kOffset.data()), ABBE_TOOL_OFFSET_MISSING);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 2, kOffset.data()), ABBE_TOOL_OFFSET_MISSING);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 2, kOther.data()), ABBE_TOOL_KNOWN);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 0, kOther.data()), ABBE_TOOL_OFFSET_MISSING)
      << "no tool in the spindle, but the offset of one";
}

TEST(ToolWatch, ATransferOfNumberAndOffsetInOneCycleIsKnown) {
  abbe_tool_watch watch{};
  abbe_watch_tool(&watch, true, 1, kOffset.data());
  EXPECT_EQ(abbe_watch_tool(&watch, true, 2, kOther.data()), ABBE_TOOL_KNOWN);
}

TEST(ToolWatch, AToolThatIsInTheSpindleAtTheStartHasNoOffsetYet) {
  abbe_tool_watch watch{};
  EXPECT_EQ(abbe_watch_tool(&watch, true, 5, kNoOffset.data()), ABBE_TOOL_OFFSET_MISSING);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 5, kOffset.data()), ABBE_TOOL_KNOWN);
}

TEST(ToolWatch, NumbersOfNoToolAreEqual) {
  abbe_tool_watch watch{};
  abbe_watch_tool(&watch, true, -1, kNoOffset.data());
  EXPECT_EQ(abbe_watch_tool(&watch, true, 0, kNoOffset.data()), ABBE_TOOL_KNOWN);
}

TEST(ToolWatch, PinsThatAreNotLinkedGiveNoTool) {
  abbe_tool_watch watch{};
  EXPECT_EQ(abbe_watch_tool(&watch, false, 0, kNoOffset.data()), ABBE_TOOL_NOT_LINKED);
  EXPECT_EQ(abbe_watch_tool(&watch, true, 1, kOffset.data()), ABBE_TOOL_OFFSET_MISSING);
}

std::shared_ptr<const Usable> decision(int number) {
  return std::make_shared<const Usable>(
      Usable{.field = {}, .reason = std::string(100, 'r'), .model_id = std::to_string(number)});
}

TEST(LatestUsable, TheLoopReadsWhatItMayWhileItIsReplaced) {
  LatestUsable latest;
  std::atomic<bool> done{false};
  std::thread deciding([&] {
    for (int i = 1; i <= 20'000; ++i) latest.set(decision(i), LatestUsable::Clock::now());
    done = true;
  });
  int newest = 0;
  while (!done) {
    const Usable& usable = latest.get();
    if (usable.model_id.empty()) continue;
    EXPECT_GE(std::stoi(usable.model_id), newest);
    newest = std::stoi(usable.model_id);
    EXPECT_EQ(usable.reason, std::string(100, 'r'));
  }
  deciding.join();
  EXPECT_EQ(latest.get().model_id, "20000");
}

TEST(LatestUsable, WhatTheLoopHasPassedIsFreed) {
  LatestUsable latest;
  for (int i = 1; i <= 100; ++i) {
    latest.set(decision(i), LatestUsable::Clock::now());
    (void)latest.get();
  }
  latest.set(decision(101), LatestUsable::Clock::now());
  EXPECT_LE(latest.kept(), 2u);
}

TEST(LatestUsable, AThreadThatDoesNotDecideIsSilent) {
  LatestUsable latest;
  const auto now = LatestUsable::Clock::now();
  EXPECT_GT(latest.silence_s(now), 1.0) << "no decision yet";
  latest.set(decision(1), now);
  EXPECT_DOUBLE_EQ(latest.silence_s(now + 300ms), 0.3);
}

/// Runs run_restarted() in a process of its own. The child writes its process id into a pipe, then
/// does what `child` does.
class Restarted : public testing::Test {
 protected:
  void start(const std::function<int()>& child) {
    ASSERT_EQ(::pipe(pipe_.data()), 0);
    parent_ = ::fork();
    if (parent_ != 0) return;
    ::_exit(run_restarted(
        [&] {
          const pid_t own = ::getpid();
          if (::write(pipe_[1], &own, sizeof own) != sizeof own) return 70;
          return child();
        },
        [](int code) { return code == 0 || code == 5; }, [](const std::string&) {}));
  }
  /// Of the next child that was started.
  pid_t child() {
    pid_t id = 0;
    EXPECT_EQ(::read(pipe_[0], &id, sizeof id), static_cast<ssize_t>(sizeof id));
    return id;
  }
  int wait_for_end() const {
    int status = 0;
    ::waitpid(parent_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  static int until_signal() {
    for (;;) ::pause();
  }
  pid_t parent_ = 0;
  std::array<int, 2> pipe_{};
};

TEST_F(Restarted, AKilledChildIsStartedAgainAndEndsWithItsParent) {
  ASSERT_NO_FATAL_FAILURE(start(until_signal));
  const pid_t first = child();
  ::kill(first, SIGKILL);
  const pid_t second = child();
  EXPECT_NE(second, first);
  ::kill(parent_, SIGTERM);
  EXPECT_EQ(wait_for_end(), 128 + SIGTERM);
  EXPECT_NE(::kill(second, 0), 0);
}

TEST_F(Restarted, AFailureIsStartedAgainAFinalCodeIsNot) {
  ASSERT_NO_FATAL_FAILURE(start([] { return 4; }));
  EXPECT_NE(child(), child());
  ::kill(parent_, SIGTERM);
  (void)wait_for_end();

  ASSERT_NO_FATAL_FAILURE(start([] { return 5; }));
  (void)child();
  EXPECT_EQ(wait_for_end(), 5);
}

}  // namespace
}  // namespace abbe::linuxcnc
