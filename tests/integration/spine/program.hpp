#pragma once
/// A program under test: started with its output in files, asked whether it still runs, stopped by
/// its process id.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace abbe::test {

constexpr std::chrono::seconds kPatience{
    60};  ///< for anything another process does; only a failure waits it out
constexpr std::chrono::seconds kPatienceForARun{
    180};  ///< for a machine's whole run, on a slow computer too

/// Calls `seen` every few milliseconds until it returns true; false after the time limit.
template <class Condition>
bool eventually(Condition seen, std::chrono::milliseconds at_most = kPatience);

/// Waits a poll period: the processes under test need time, and do not report when they are done.
void wait_a_little();

class Program {
 public:
  /// `command[0]` is the file to run; standard output and error go to `log`.out and `log`.err.
  Program(std::vector<std::string> command, std::filesystem::path log);
  ~Program();  ///< SIGKILL, should it still run
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] bool running();
  void signal(int number) const;
  /// The exit code; minus the signal that ended it; after `at_most` it is killed.
  int wait_for_end(std::chrono::milliseconds at_most = kPatience);
  int stop();  ///< SIGTERM, then wait_for_end()

  [[nodiscard]] std::string out() const;
  [[nodiscard]] std::string err() const;

 private:
  std::filesystem::path log_;
  pid_t pid_ = 0;  ///< 0: ended
  int code_ = 0;   ///< once ended
};

template <class Condition>
bool eventually(Condition seen, std::chrono::milliseconds at_most) {
  const auto deadline = std::chrono::steady_clock::now() + at_most;
  while (!seen()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    wait_a_little();
  }
  return true;
}

/// A whole file; empty when there is none.
std::string text_of(const std::filesystem::path& file);
/// `text` with `by` for everything that `pattern` (ECMAScript) finds; nothing found fails the test.
std::string replaced(const std::string& text, const std::string& pattern, const std::string& by);

}  // namespace abbe::test
