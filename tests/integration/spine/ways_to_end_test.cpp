/// Every way abbed can end while a measuring machine moves at its command. The table is printed:
/// `test_spine --gtest_filter='*WaysToEnd*:*EveryWay*:UnreadStderr*' | grep '^| '`.

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <regex>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/end_limits.hpp"
#include "hung_hub.hpp"
#include "moving_machine.hpp"

namespace abbe::test {
namespace {

using testing::HasSubstr;

constexpr int kStopped = 0, kInternalError = 70;

struct WaysToEnd : MovingMachine {
  WaysToEnd() : machine{slow_machine()} {}

  void begin() {
    ASSERT_NO_FATAL_FAILURE(start_at(machine));
    ASSERT_NO_FATAL_FAILURE(begin_touch(machine));
  }
  [[nodiscard]] bool aborted() {
    return eventually([this] { return !machine.moving(); }, std::chrono::seconds{10}) &&
           testing::Value(machine.heard(), testing::Contains("AbortE()"));
  }
  /// One row of the table.
  static void report(const std::string& way, bool abort_sent, int code, const std::string& says) {
    fmt::print("| {} | {} | {} | {} |\n", way, abort_sent ? "yes" : "no",
               code < 0 ? fmt::format("signal {}", -code) : std::to_string(code), says);
  }
  /// The first line of abbed's stderr that contains `what`.
  [[nodiscard]] std::string line_with(const std::string& what) const {
    std::istringstream lines{abbed_->err()};
    for (std::string line; std::getline(lines, line);)
      if (line.find(what) != std::string::npos) return line;
    return "no line with \"" + what + "\" in:\n" + abbed_->err();
  }

  MachineInAThread machine;
};

/// A signal, and what abbed does with it.
struct SentSignal {
  int number;
  enum class Then { EndsInOrder, Crashes, IsIgnored } then;
};

std::string name_of_signal(int number) {
  const char* const name = ::sigabbrev_np(number);
  return name != nullptr ? name : fmt::format("RT{}", number);
}

struct EveryWay : WaysToEnd, testing::WithParamInterface<SentSignal> {};

TEST_P(EveryWay, EndsWithAnAbortOrDoesNotEnd) {
  const auto [number, then] = GetParam();
  const std::string name = "SIG" + name_of_signal(number);
  ASSERT_NO_FATAL_FAILURE(begin());
  abbed_->signal(number);

  if (then == SentSignal::Then::IsIgnored) {
    ASSERT_TRUE(eventually([this] { return status().is_object() || !abbed_->running(); }));
    ASSERT_TRUE(abbed_->running()) << name;
    EXPECT_TRUE(machine.moving()) << "nothing has happened";
    report(name, false, 0, "ignored: abbed runs on");
    abbed_->signal(SIGTERM);
  }

  EXPECT_TRUE(aborted());
  const int code = abbed_->wait_for_end();
  if (then == SentSignal::Then::Crashes) {
    const std::string says = line_with("internal error: ended by ");
    EXPECT_NE(code, 0);
    EXPECT_THAT(abbed_->err(), HasSubstr("AbortE was sent to the measuring machine"));
    report(name, true, code, says);
  } else {
    EXPECT_EQ(code, kStopped) << abbed_->err();
    EXPECT_THAT(abbed_->err(), HasSubstr("abbed: stopped"));
    if (then == SentSignal::Then::EndsInOrder)
      report(name, true, code, line_with("ends in order after " + name));
  }
}

std::vector<SentSignal> all_signals() {
  using enum SentSignal::Then;
  return {{SIGTERM, EndsInOrder},    {SIGINT, EndsInOrder},  {SIGHUP, EndsInOrder},
          {SIGQUIT, EndsInOrder},    {SIGPWR, EndsInOrder},  {SIGXCPU, EndsInOrder},
          {SIGPIPE, IsIgnored},      {SIGUSR1, IsIgnored},   {SIGUSR2, IsIgnored},
          {SIGALRM, IsIgnored},      {SIGVTALRM, IsIgnored}, {SIGPROF, IsIgnored},
          {SIGIO, IsIgnored},        {SIGSTKFLT, IsIgnored}, {SIGXFSZ, IsIgnored},
          {SIGTSTP, IsIgnored},      {SIGTTIN, IsIgnored},   {SIGTTOU, IsIgnored},
          {SIGRTMIN + 3, IsIgnored}, {SIGSEGV, Crashes},     {SIGBUS, Crashes},
          {SIGFPE, Crashes},         {SIGILL, Crashes},      {SIGSYS, Crashes},
          {SIGTRAP, Crashes},        {SIGABRT, Crashes}};
}
INSTANTIATE_TEST_SUITE_P(Signals, EveryWay, testing::ValuesIn(all_signals()),
                         [](const auto& info) { return name_of_signal(info.param.number); });

// Every signal that ends a process is in the list above, but for those that cannot be caught.
TEST(EverySignal, IsDecidedOn) {
  const auto listed = all_signals();
  for (int number = 1; number < SIGRTMIN; ++number) {
    if (number == SIGKILL || number == SIGSTOP || number >= 32) continue;
    const bool harmless = number == SIGCHLD || number == SIGCONT || number == SIGURG ||
                          number == SIGWINCH;  // their default action ends nothing
    EXPECT_NE(harmless,
              std::ranges::any_of(listed, [&](const SentSignal& s) { return s.number == number; }))
        << ::sigabbrev_np(number);
  }
}

/// abbed with a named pipe as stderr, which the test opens for reading but does not read.
struct UnreadStderr : WaysToEnd {
  void begin_at_a_pipe() {
    ASSERT_EQ(::mkfifo(file("abbed.err").c_str(), 0600), 0);
    reader = ::open(file("abbed.err").c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(reader, 0);
    ASSERT_NO_FATAL_FAILURE(begin());
  }
  void fill_the_pipe() const {
    const int writer = ::open(file("abbed.err").c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
    ASSERT_GE(writer, 0);
    for (const std::string many(4096, 'x'); ::write(writer, many.data(), many.size()) > 0;) {
    }
    while (::write(writer, "x", 1) > 0) {
    }
    ::close(writer);
  }
  void close_reader() {
    if (reader >= 0) ::close(std::exchange(reader, -1));
  }
  ~UnreadStderr() override {
    close_reader();
    std::filesystem::remove(file("abbed.err"));  // a failed test reads it
  }

  int reader = -1;
};

TEST_F(UnreadStderr, DoesNotKeepAbbedFromEnding) {
  ASSERT_NO_FATAL_FAILURE(begin_at_a_pipe());
  ASSERT_NO_FATAL_FAILURE(fill_the_pipe());
  abbed_->signal(SIGTERM);
  EXPECT_TRUE(aborted());
  const int code = abbed_->wait_for_end();
  EXPECT_EQ(code, kStopped);
  report("SIGTERM, stderr is a full pipe that nobody reads", true, code, "lost");
}

TEST_F(UnreadStderr, DoesNotKeepAbbedFromEndingWhoseHubHangs) {
  ASSERT_NO_FATAL_FAILURE(begin_at_a_pipe());
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (!stop_thread(hub)) GTEST_SKIP() << "ptrace is not allowed here";
  ASSERT_NO_FATAL_FAILURE(fill_the_pipe());
  abbed_->signal(SIGTERM);
  EXPECT_TRUE(aborted());
  keep_stopped_to_the_end(hub);
  const int code = abbed_->wait_for_end();
  EXPECT_EQ(code, kInternalError);
  report("SIGTERM, the hub hangs, nobody reads stderr", true, code, "lost");
}

TEST_F(UnreadStderr, DoesNotDelayACrash) {
  ASSERT_NO_FATAL_FAILURE(begin_at_a_pipe());
  ASSERT_NO_FATAL_FAILURE(fill_the_pipe());
  abbed_->signal(SIGABRT);
  EXPECT_TRUE(aborted());
  close_reader();  // the report of a sanitizer would wait for it
  const int code = abbed_->wait_for_end();
  EXPECT_NE(code, kStopped);
  report("SIGABRT, nobody reads stderr", true, code, "lost");
}

TEST_F(UnreadStderr, ATeeThatDiedDoesNotEndAbbed) {
  ASSERT_NO_FATAL_FAILURE(begin_at_a_pipe());
  close_reader();
  EXPECT_FALSE(ask({{"do", "no such request"}}));
  const auto stopped = ask({{"do", "machine"}, {"stop", true}});  // the journal writes a line
  EXPECT_TRUE(stopped) << stopped.error().text;
  EXPECT_TRUE(aborted());
  ASSERT_TRUE(eventually([this] { return stream("cmm")["state"] == "awaiting release"; }));
  EXPECT_TRUE(abbed_->running());
  abbed_->signal(SIGTERM);
  const int code = abbed_->wait_for_end();
  EXPECT_EQ(code, kStopped);
  report("the reader of stderr ends (`abbed 2>&1 | tee`)", false, code, "ignored: abbed runs on");
}

TEST_F(WaysToEnd, AHubThatHangsStopsTheMachineWithoutAWatchdog) {
  ASSERT_NO_FATAL_FAILURE(begin());
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (!stop_thread(hub)) GTEST_SKIP() << "ptrace is not allowed here";
  EXPECT_TRUE(aborted()) << "although nobody has stopped abbed";
  abbed_->signal(SIGTERM);
  keep_stopped_to_the_end(hub);
  const int code = abbed_->wait_for_end();
  EXPECT_EQ(code, kInternalError);
  report("the hub hangs", true, code, line_with("the hub hangs"));
}

/// systemd's watchdog sends SIGABRT when it is not fed: here the main thread, which feeds it,
/// hangs.
TEST_F(WaysToEnd, TheWatchdogStopsTheMachineWhenTheMainThreadHangs) {
  ASSERT_NO_FATAL_FAILURE(begin());
  if (!stop_thread(abbed_->pid())) GTEST_SKIP() << "ptrace is not allowed here";
  const pid_t any = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(any, 0);
  ASSERT_EQ(::tgkill(abbed_->pid(), any, SIGABRT), 0);  // the kernel chooses a thread that runs
  EXPECT_TRUE(aborted());
  keep_stopped_to_the_end(abbed_->pid());  // also takes the exit status
  const std::string says = line_with("internal error: ended by ");
  EXPECT_THAT(says, HasSubstr("Aborted"));
  report("watchdog of systemd (SIGABRT), the main thread hangs", true, -SIGABRT, says);
}

/// The unit and the program agree on how long an orderly end may take.
TEST(AbbedUnit, WaitsLongerThanAbbedNeedsToEnd) {
  const auto unit = text_of(std::filesystem::path{ABBE_UNIT_DIR} / "abbed.service");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(unit, found, std::regex{"\nTimeoutStopSec=([0-9]+)\n"}));
  EXPECT_GT(std::chrono::seconds{std::stoi(found[1])}, daemon::kLongestEnd);
}

}  // namespace
}  // namespace abbe::test
