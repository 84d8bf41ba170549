#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <utility>

namespace abbe::daemon {

/// Writes log lines about clients. A client that connects again and again must not fill the
/// journal; therefore a limited number of lines per subject is written in a period. The next line
/// that is written states how many were left out. `Write` escapes characters that a client may have
/// sent, as print_message() does. Thread-safe.
class LimitedLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Write = std::function<void(const std::string& line)>;
  struct Limit {
    std::size_t lines;  ///< most lines of one subject in each period
    std::chrono::seconds period;
  };
  static constexpr std::size_t kMostSubjects = 1000;

  LimitedLog(Write write, Limit limit) : write_(std::move(write)), limit_(limit) {}
  /// `subject` is an address or a kind of event; lines of one subject are counted together.
  void line(const std::string& subject, const std::string& text,
            Clock::time_point now = Clock::now());
  /// A line that is never left out.
  void always(const std::string& text) { write_(text); }

 private:
  struct Period {
    Clock::time_point began;
    std::size_t written = 0;
    std::size_t left_out = 0;
  };

  Write write_;
  Limit limit_;
  std::mutex mutex_;
  std::map<std::string, Period> periods_;
};

}  // namespace abbe::daemon
