#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace abbe::web {

/// Lines for the log. Of a subject that occurs again and again, one line in kPeriod is passed on,
/// with the number of lines that were left out. Thread-safe.
class LimitedReport {
 public:
  static constexpr std::chrono::seconds kPeriod{10};
  static constexpr std::size_t kMostSubjects = 1000;

  explicit LimitedReport(std::function<void(const std::string&)> sink) : sink_(std::move(sink)) {}
  /// `subject` is an address or a kind of event; lines of one subject are counted together.
  void line(const std::string& subject, const std::string& text);
  /// A line that is never left out.
  void always(const std::string& text);

 private:
  using Clock = std::chrono::steady_clock;
  struct Last {
    Clock::time_point at;
    std::size_t left_out = 0;
  };

  std::function<void(const std::string&)> sink_;
  std::mutex mutex_;
  std::map<std::string, Last> last_;
};

}  // namespace abbe::web
