#include "abbe/publishing/dds_supervisor.hpp"

#include <gtest/gtest.h>
#include <linux/capability.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using WallTime = DdsSupervisor::WallTime;

/// Runs `script` in a shell; what the supervisor appends lands in $1 and $2.
DdsSupervisor::Options shell(const std::string& script) {
  DdsSupervisor::Options options;
  options.program = "/bin/sh";
  options.arguments = {"-c", script, "sh"};
  return options;
}

/// Blocks until the child is a zombie, without reaping it.
void wait_for_end(pid_t pid) {
  siginfo_t info{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT), 0);
}

/// How the last child ended, without the time.
std::string end_of(const DdsSupervisor& supervisor) {
  const std::string text = supervisor.last_end() ? supervisor.last_end()->text() : "";
  return text.substr(0, text.find(" at "));
}

TEST(DdsSupervisor, RefusesAProgramThatDoesNotExist) {
  DdsSupervisor::Options options;
  options.program = "/nonexistent/abbe-dds";
  EXPECT_FALSE(DdsSupervisor::start(options, WallTime{}).has_value());
}

TEST(DdsSupervisor, RestartsAtOnceAfterAnExitInSteadyState) {
  auto supervisor = DdsSupervisor::start(shell("exec sleep 60"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  const pid_t first = supervisor->pid();
  ::kill(first, SIGKILL);
  wait_for_end(first);
  supervisor->poll(WallTime{10s});
  EXPECT_NE(supervisor->pid(), 0);
  EXPECT_NE(supervisor->pid(), first);
  EXPECT_EQ(supervisor->restarts(), 1u);
  EXPECT_EQ(end_of(*supervisor), "signal 9 (Killed)");
}

TEST(DdsSupervisor, BacksOffWhenTheChildExitsAtStart) {
  auto supervisor = DdsSupervisor::start(shell("exit 3"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  wait_for_end(supervisor->pid());
  supervisor->poll(WallTime{1ms});

  EXPECT_EQ(supervisor->pid(), 0);
  EXPECT_EQ(end_of(*supervisor), "exit code 3");
  supervisor->poll(WallTime{100ms});
  EXPECT_EQ(supervisor->pid(), 0);
  supervisor->poll(WallTime{101ms});
  ASSERT_NE(supervisor->pid(), 0);
  wait_for_end(supervisor->pid());
  supervisor->poll(WallTime{102ms});
  supervisor->poll(WallTime{301ms});
  EXPECT_EQ(supervisor->restarts(), 1u);
  supervisor->poll(WallTime{302ms});
  EXPECT_EQ(supervisor->restarts(), 2u);
}

TEST(DdsSupervisor, ASignalAtStartIsFollowedByTheFirstDelayEveryTime) {
  auto supervisor = DdsSupervisor::start(shell("kill -SEGV $$"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  for (int death = 1; death <= 3; ++death) {
    const auto died = WallTime{death * 1s};
    wait_for_end(supervisor->pid());
    supervisor->poll(died);
    EXPECT_EQ(supervisor->pid(), 0);
    supervisor->poll(died + 100ms);
    ASSERT_NE(supervisor->pid(), 0) << "death " << death;
  }
}

/// Asks and never answers, after one answer.
TEST(DdsSupervisor, EndsAndReplacesAChildThatDoesNotAnswer) {
  DdsProcess process;
  auto options = shell("exec sleep 60");
  options.process = &process;
  auto supervisor = DdsSupervisor::start(options, WallTime{1s});

  ASSERT_TRUE(supervisor.has_value());
  const pid_t hung = supervisor->pid();
  EXPECT_EQ(process.pid(), hung);
  process.answered(WallTime{2s});
  for (auto at = 1s + 0ms; at <= 4s; at += 100ms) process.asked(WallTime{at});
  supervisor->poll(WallTime{4s});
  EXPECT_EQ(supervisor->pid(), hung);
  process.asked(WallTime{4s + 1ms});
  supervisor->poll(WallTime{4s + 1ms});
  wait_for_end(hung);
  supervisor->poll(WallTime{4s + 20ms});
  EXPECT_NE(supervisor->pid(), hung);
  EXPECT_EQ(process.pid(), supervisor->pid());
  EXPECT_EQ(process.restarts(), 1u);
  ASSERT_TRUE(process.last_end());
  EXPECT_EQ(end_of(*supervisor), "it did not answer and was ended by abbed");
  EXPECT_EQ(process.last_end()->text(), supervisor->last_end()->text());
}

TEST(DdsSupervisor, AMissingProgramIsReportedAndTriedAgain) {
  const auto program =
      std::filesystem::path{::testing::TempDir()} / ("abbe-gone-" + std::to_string(::getpid()));
  std::filesystem::create_symlink("/bin/sh", program);
  DdsProcess process;
  auto options = shell("exec sleep 60");
  options.program = program;
  options.process = &process;
  auto supervisor = DdsSupervisor::start(options, WallTime{});

  ASSERT_TRUE(supervisor.has_value());
  std::filesystem::remove(program);
  const pid_t first = supervisor->pid();
  ::kill(first, SIGKILL);
  wait_for_end(first);
  supervisor->poll(WallTime{10s});
  EXPECT_EQ(supervisor->pid(), 0);
  EXPECT_EQ(supervisor->restarts(), 0u);
  EXPECT_NE(supervisor->start_fault().find("No such file"), std::string::npos)
      << supervisor->start_fault();
  EXPECT_EQ(end_of(*supervisor), "signal 9 (Killed)");
  std::filesystem::create_symlink("/bin/sh", program);
  supervisor->poll(WallTime{15s});
  EXPECT_NE(supervisor->pid(), 0);
  EXPECT_EQ(supervisor->restarts(), 1u);
  EXPECT_EQ(process.restarts(), 1u);
  EXPECT_EQ(supervisor->start_fault(), "");
  std::filesystem::remove(program);
}

TEST(DdsSupervisor, ADelayOfTheHubDoesNotCountAsSilenceOfTheChild) {
  DdsProcess process;
  auto options = shell("exec sleep 60");
  options.process = &process;
  auto supervisor = DdsSupervisor::start(options, WallTime{1s});
  ASSERT_TRUE(supervisor.has_value());
  process.asked(WallTime{2s});
  process.answered(WallTime{2s});
  const pid_t child = supervisor->pid();
  supervisor->poll(WallTime{60s});
  EXPECT_EQ(supervisor->pid(), child);
  EXPECT_EQ(process.silent_for(), 0ns);
}

/// As after SIGSTOP and SIGCONT of the whole abbed: the answer to the last beat is not read yet.
TEST(DdsProcess, AfterAPauseOfTheHubTheSilenceTimerRestarts) {
  DdsProcess process;
  process.started(4711, WallTime{1s});
  for (auto at = 1s + 0ms; at <= 2s; at += 100ms) process.asked(WallTime{at});
  process.answered(WallTime{1900ms});
  process.asked(WallTime{5s});
  EXPECT_EQ(process.silent_for(), 0ns);
  for (auto at = 5s + 100ms; at <= 7s; at += 100ms) process.asked(WallTime{at});
  EXPECT_EQ(process.silent_for(), 2s);
}

TEST(DdsSupervisor, PassesTheParentsProcessIdToTheChild) {
  const std::string me = std::to_string(::getpid());
  auto supervisor =
      DdsSupervisor::start(shell("[ \"$1 $2\" = \"--parent " + me + "\" ] && exit 7"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  wait_for_end(supervisor->pid());
  supervisor->poll(WallTime{1ms});
  EXPECT_EQ(end_of(*supervisor), "exit code 7");
}

/// CAP_IPC_LOCK in the calling thread's ambient set, as systemd gives it to abbed. False where the
/// system does not allow it.
bool take_an_ambient_capability() {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, 2> sets{};
  if (::syscall(SYS_capget, &header, sets.data()) != 0) return false;
  sets[0].inheritable |= 1u << CAP_IPC_LOCK;
  return ::syscall(SYS_capset, &header, sets.data()) == 0 &&
         ::prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, CAP_IPC_LOCK, 0UL, 0UL) == 0;
}

TEST(DdsSupervisor, TheChildInheritsNoCapability) {
  std::optional<std::string> ended;
  std::thread([&ended] {  // a thread of its own: capabilities are a thread's
    if (!take_an_ambient_capability()) return;
    auto supervisor =
        DdsSupervisor::start(shell("while read name set; do [ \"$name\" = CapAmb: ] && [ "
                                   "\"$set\" = 0000000000000000 ] && exit 7; done "
                                   "</proc/self/status; exit 8"),
                             WallTime{});
    ASSERT_TRUE(supervisor.has_value());
    wait_for_end(supervisor->pid());
    supervisor->poll(WallTime{1ms});
    ended = end_of(*supervisor);
  })
      .join();
  if (!ended) GTEST_SKIP() << "this user may not raise an ambient capability";

  EXPECT_EQ(*ended, "exit code 7");
}

TEST(DdsSupervisor, GivesTheChildItsPriorityWherePermitted) {
  sched_param mine{};
  mine.sched_priority = 1;
  const bool permitted = ::sched_setscheduler(0, SCHED_FIFO, &mine) == 0;
  mine.sched_priority = 0;
  ASSERT_EQ(::sched_setscheduler(0, SCHED_OTHER, &mine), 0);
  auto options = shell("exec sleep 60");
  options.priority = 20;
  auto supervisor = DdsSupervisor::start(options, WallTime{});
  ASSERT_TRUE(supervisor.has_value()) << supervisor.error().text;
  EXPECT_EQ(::sched_getscheduler(supervisor->pid()), permitted ? SCHED_FIFO : SCHED_OTHER);
}

TEST(DdsSupervisor, StopsItsChildWhenItEnds) {
  pid_t child = 0;
  {
    auto supervisor = DdsSupervisor::start(shell("exec sleep 60"), WallTime{});
    ASSERT_TRUE(supervisor.has_value());
    child = supervisor->pid();
  }
  EXPECT_EQ(::kill(child, 0), -1);
}

}  // namespace
}  // namespace abbe::daemon
