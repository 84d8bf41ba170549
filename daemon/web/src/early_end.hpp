#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "abbe/web/task_limits.hpp"

namespace abbe::web {

/// Whether a task must end before its end. Belongs to the thread of the task.
class EarlyEnd {
 public:
  /// `what`: "replay", "identification". `ended`: why it is to end; empty: it is not. It is asked
  /// often.
  EarlyEnd(std::string what, const TaskLimits& limits, std::function<std::string()> ended)
      : what_(std::move(what)), limits_(limits), ended_(std::move(ended)) {}

  /// Once true, it stays so.
  bool wanted() {
    if (!reason_) reason_ = reason_now();
    return reason_.has_value();
  }
  /// nullopt: not wanted.
  [[nodiscard]] const std::optional<std::string>& reason() const { return reason_; }

 private:
  using Clock = std::chrono::steady_clock;
  std::optional<std::string> reason_now();

  std::string what_;
  TaskLimits limits_;
  std::function<std::string()> ended_;
  Clock::time_point begin_ = Clock::now(), next_memory_ = begin_;
  std::optional<std::string> reason_;
};

}  // namespace abbe::web
