/// stderr that nobody reads, or whose reader is gone. Each in a process of its own, because stderr
/// belongs to the process.

#include "abbe/base/standard_error.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <functional>
#include <iostream>
#include <string>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::EndsWith;
using ::testing::HasSubstr;

struct PipeEnds {
  PipeEnds() { EXPECT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0); }
  ~PipeEnds() {
    close_reader();
    close_writer();
  }
  PipeEnds(const PipeEnds&) = delete;
  PipeEnds& operator=(const PipeEnds&) = delete;
  void close_reader() { close_end(0); }
  void close_writer() { close_end(1); }
  /// Until the writer has closed its end.
  [[nodiscard]] std::string read_all() const {
    std::string all;
    std::array<char, 4096> bytes{};
    for (ssize_t n = 0; (n = ::read(ends[0], bytes.data(), bytes.size())) > 0;)
      all.append(bytes.data(), static_cast<std::size_t>(n));
    return all;
  }
  void close_end(std::size_t i) {
    if (ends.at(i) >= 0) ::close(std::exchange(ends.at(i), -1));
  }
  std::array<int, 2> ends{-1, -1};
};

/// Runs `act` in a child process whose stderr is the pipe. The child ends by exit(): as main()
/// does.
pid_t start_with_stderr(PipeEnds& pipe, const std::function<void()>& act) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGPIPE, SIG_DFL);
    ::dup2(pipe.ends[1], STDERR_FILENO);
    unblock_stderr("test");
    act();
    drain_stderr();
    ::_exit(0);
  }
  pipe.close_writer();
  return child;
}

/// The exit code; minus the signal. A child that hangs lets the test run into its time limit.
int end_of(pid_t child) {
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

TEST(StandardError, PassesOnEverythingInOrder) {
  PipeEnds pipe;
  const pid_t child = start_with_stderr(pipe, [] {
    fmt::print(stderr, "one {}\n", 1);
    std::cerr << "two " << 2 << '\n';
    std::fputs("three\n", stderr);
    std::perror("four");
  });
  EXPECT_THAT(pipe.read_all(), testing::StartsWith("one 1\ntwo 2\nthree\nfour: "));
  EXPECT_EQ(end_of(child), 0);
}

TEST(StandardError, APipeThatNobodyReadsDoesNotBlock) {
  PipeEnds pipe;
  const std::string line(1000, 'x');
  const pid_t child = start_with_stderr(pipe, [&] {
    for (int i = 0; i < 2000; ++i) fmt::print(stderr, "{}\n", line);  // 2 MB
  });
  EXPECT_EQ(end_of(child), 0);  // the pipe is read by nobody
}

TEST(StandardError, ReportsHowManyMessagesWereLost) {
  PipeEnds pipe;
  PipeEnds full;  // the child reports here that it has written everything
  const std::string line(1000, 'x');
  const pid_t child = start_with_stderr(pipe, [&] {
    for (int i = 0; i < 2000; ++i) fmt::print(stderr, "{}\n", line);
    full.close_writer();
    drain_stderr(60s);
    fmt::print(stderr, "after\n");
    drain_stderr(60s);
  });
  full.close_writer();
  EXPECT_EQ(full.read_all(), "");
  const std::string seen = pipe.read_all();
  EXPECT_EQ(end_of(child), 0);
  EXPECT_THAT(seen, HasSubstr("messages were lost: stderr was not read"));
  EXPECT_THAT(seen, EndsWith("after\n"));
}

TEST(StandardError, AReaderThatIsGoneEndsNothing) {
  PipeEnds pipe;
  pipe.close_reader();
  const pid_t child = start_with_stderr(pipe, [] {
    for (int i = 0; i < 10; ++i) {
      fmt::print(stderr, "line\n");
      drain_stderr(60s);
    }
  });
  EXPECT_EQ(end_of(child), 0);
}

TEST(StandardError, AWriteForTheEndOfAProcessGivesUp) {
  PipeEnds pipe;
  const std::string much(1 << 20, 'x');
  EXPECT_FALSE(write_within(pipe.ends[1], much, 20ms));
  std::array<char, 65536> bytes{};
  ASSERT_GT(::read(pipe.ends[0], bytes.data(), bytes.size()), 0);
  EXPECT_TRUE(write_within(pipe.ends[1], "last words\n", 20ms));
}

}  // namespace
}  // namespace abbe::daemon
