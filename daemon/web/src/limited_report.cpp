#include "limited_report.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::web {
namespace {

/// Without control characters, which a browser may have sent.
std::string printable(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return text;
}

}  // namespace

void LimitedReport::line(const std::string& subject, const std::string& text) {
  std::string more;
  {
    const std::lock_guard lock(mutex_);
    const auto now = Clock::now();
    if (last_.size() >= kMostSubjects)
      std::erase_if(last_, [now](const auto& entry) { return now - entry.second.at >= kPeriod; });
    if (last_.size() >= kMostSubjects) return;
    const auto [entry, first] = last_.try_emplace(subject, Last{now, 0});
    if (!first && now - entry->second.at < kPeriod) {
      ++entry->second.left_out;
      return;
    }
    if (entry->second.left_out > 0)
      more = fmt::format(" ({} more in between)", entry->second.left_out);
    entry->second = {now, 0};
  }
  sink_(printable(text) + more);
}

void LimitedReport::always(const std::string& text) {
  sink_(printable(text));
}

}  // namespace abbe::web
