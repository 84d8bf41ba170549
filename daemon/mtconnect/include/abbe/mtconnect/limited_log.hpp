#pragma once
/// Limits the lines about clients: a program that connects and closes every second, such as a port
/// monitor, must not fill the journal. Not thread-safe.

#include <chrono>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>

namespace abbe::mtconnect {

class LimitedLog {
 public:
  using Clock = std::chrono::steady_clock;
  using Write = std::function<void(std::string_view line)>;

  static constexpr std::uint32_t kLines = 20;  ///< in each kPeriod
  static constexpr std::chrono::minutes kPeriod{1};

  explicit LimitedLog(Write write) : write_(std::move(write)) {}
  /// Writes the line, or counts it. Before the first line of the next period it writes the number
  /// of lines that were not written.
  void line(std::string_view text, Clock::time_point now = Clock::now());

 private:
  Write write_;
  Clock::time_point began_{};
  std::uint32_t written_ = 0;
  std::uint64_t omitted_ = 0;
};

}  // namespace abbe::mtconnect
