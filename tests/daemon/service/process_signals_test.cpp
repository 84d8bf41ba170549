/// Crashes of a process that moves a machine: each in a process of its own, whose machine is at the
/// other end of a socket.

#include "abbe/service/process_signals.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>

#include "abbe/drivers/emergency_stop.hpp"

namespace abbe::daemon {
namespace {

struct Ended {
  int status = 0;
  std::string machine_heard, err;
};

std::string read_to_end(int fd) {
  std::string all;
  std::array<char, 4096> bytes{};
  for (ssize_t n = 0; (n = ::read(fd, bytes.data(), bytes.size())) > 0;)
    all.append(bytes.data(), static_cast<std::size_t>(n));
  ::close(fd);
  return all;
}

/// Runs `crash` in a process that moves a machine.
Ended end_of(const std::function<void()>& crash) {
  std::array<int, 2> machine{}, err{};
  EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, machine.data()), 0);
  EXPECT_EQ(::pipe(err.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(machine[1]);
    ::dup2(err[1], STDERR_FILENO);
    ::close(err[1]);
    drivers::EmergencyStop stop{"AbortE\n", "done"};
    stop.set_socket(machine[0]);
    stop.set_moving(true);
    (void)prepare_signals();
    crash();
    ::_exit(0);
  }
  ::close(machine[0]);
  ::close(err[1]);
  Ended ended{.machine_heard = read_to_end(machine[1]), .err = read_to_end(err[0])};
  EXPECT_EQ(::waitpid(child, &ended.status, 0), child);
  return ended;
}

void expect_stopped(const Ended& ended, const std::string& message) {
  EXPECT_EQ(ended.machine_heard, "AbortE\n");
  EXPECT_FALSE(WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == 0);
  EXPECT_THAT(ended.err, testing::HasSubstr(message));
  EXPECT_THAT(ended.err, testing::HasSubstr("AbortE was sent to the measuring machine"));
}

TEST(ProcessSignals, AnUncaughtExceptionOfAThreadStopsTheMachine) {
  const auto ended =
      end_of([] { std::thread([] { throw std::runtime_error("no such register"); }).join(); });
  expect_stopped(ended, "uncaught exception: no such register");
}

TEST(ProcessSignals, AnExceptionThatMayNotLeaveAFunctionStopsTheMachine) {
  const auto ended = end_of([] {
    const std::function<void()> throws = [] { throw 1; };
    const auto careful = [&throws]() noexcept { throws(); };  // NOLINT(bugprone-exception-escape)
    careful();
  });
  expect_stopped(ended, "uncaught exception");
}

TEST(ProcessSignals, AWrongAddressStopsTheMachine) {
  const auto ended = end_of([] { ::raise(SIGSEGV); });
  expect_stopped(ended, "ended by Segmentation fault");
}

TEST(ProcessSignals, AnAssertionStopsTheMachine) {
  expect_stopped(end_of([] { std::abort(); }), "ended by Aborted");
}

TEST(ProcessSignals, SignalsOfOthersChangeNothing) {
  const auto ended = end_of([] {
    for (const int number : {SIGPIPE, SIGUSR1, SIGUSR2, SIGALRM, SIGTSTP, SIGTTOU}) ::raise(number);
  });
  EXPECT_EQ(ended.machine_heard, "");
  EXPECT_TRUE(WIFEXITED(ended.status));
  EXPECT_EQ(WEXITSTATUS(ended.status), 0);
}

TEST(ProcessSignals, AreNamed) {
  EXPECT_EQ(signal_name(SIGHUP), "SIGHUP");
  EXPECT_EQ(signal_name(SIGRTMAX), "signal 64");
}

}  // namespace
}  // namespace abbe::daemon
