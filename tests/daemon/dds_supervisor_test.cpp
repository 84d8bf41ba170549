#include "abbe/daemon/dds_supervisor.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

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

TEST(DdsSupervisor, RefusesAProgramThatDoesNotExist) {
  DdsSupervisor::Options options;
  options.program = "/nonexistent/abbe-dds";
  EXPECT_FALSE(DdsSupervisor::start(options, WallTime{}).has_value());
}

TEST(DdsSupervisor, StartsAgainAtOnceAfterADeathInSteadyState) {
  auto supervisor = DdsSupervisor::start(shell("exec sleep 60"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  const pid_t first = supervisor->pid();
  ::kill(first, SIGKILL);
  wait_for_end(first);
  supervisor->poll(WallTime{10s});
  EXPECT_NE(supervisor->pid(), 0);
  EXPECT_NE(supervisor->pid(), first);
  EXPECT_EQ(supervisor->restarts(), 1u);
  EXPECT_EQ(supervisor->last_end(), "signal 9");
}

TEST(DdsSupervisor, BacksOffWhenTheChildDiesAtStart) {
  auto supervisor = DdsSupervisor::start(shell("exit 3"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  wait_for_end(supervisor->pid());
  supervisor->poll(WallTime{1ms});
  EXPECT_EQ(supervisor->pid(), 0);
  EXPECT_EQ(supervisor->last_end(), "exit code 3");
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

TEST(DdsSupervisor, TellsTheChildWhoItsParentIs) {
  const std::string me = std::to_string(::getpid());
  auto supervisor =
      DdsSupervisor::start(shell("[ \"$1 $2\" = \"--parent " + me + "\" ] && exit 7"), WallTime{});
  ASSERT_TRUE(supervisor.has_value());
  wait_for_end(supervisor->pid());
  supervisor->poll(WallTime{1ms});
  EXPECT_EQ(supervisor->last_end(), "exit code 7");
}

TEST(DdsSupervisor, StopsItsChildWhenItGoes) {
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
