#pragma once
/// A program under test: started, its standard output read line by line with the time each line
/// came, killed at the end.

#include <sys/types.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace abbe::test {

using Clock = std::chrono::steady_clock;

inline double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

struct Line {
  std::string text;
  Clock::time_point came;
};

class Process {
 public:
  /// `on_line`: takes every line, from a thread of its own; then none is kept here.
  using OnLine = std::function<void(const Line&)>;
  explicit Process(std::vector<std::string> command, OnLine on_line = nullptr);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// The exit code, -1 if it ended by a signal or not within `at_most` (then it is killed).
  int wait_for_end(std::chrono::seconds at_most = std::chrono::seconds{20});

  /// The first line not before `from` that begins with `prefix`; nothing if none came within
  /// `at_most`.
  std::optional<Line> wait_for(const std::string& prefix, Clock::time_point from = {},
                               std::chrono::seconds at_most = std::chrono::seconds{20});
  std::vector<Line> lines();
  /// All lines, for the message of a failed expectation.
  std::string transcript();

 private:
  void read(int fd);

  pid_t pid_ = 0;
  OnLine on_line_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Line> lines_;
  bool ended_ = false;
  std::thread reader_;
};

}  // namespace abbe::test
