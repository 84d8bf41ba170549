#include "abbe/base/limited_log.hpp"

#include <fmt/format.h>

#include <map>

namespace abbe::daemon {
void LimitedLog::line(const std::string& subject, const std::string& text, Clock::time_point now) {
  std::size_t left_out = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto is_over = [&](const auto& entry) {
      return now - entry.second.began >= limit_.period;
    };
    if (periods_.size() >= kMostSubjects) std::erase_if(periods_, is_over);
    if (periods_.size() >= kMostSubjects) return;
    const auto entry = periods_.try_emplace(subject, Period{now}).first;
    auto& period = entry->second;
    if (is_over(*entry)) period = {.began = now, .left_out = period.left_out};
    if (period.written >= limit_.lines) {
      ++period.left_out;
      return;
    }
    ++period.written;
    left_out = std::exchange(period.left_out, 0);
  }
  write_(left_out > 0 ? fmt::format("{} ({} more in between)", text, left_out) : text);
}

}  // namespace abbe::daemon
