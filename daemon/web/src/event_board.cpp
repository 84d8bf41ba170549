#include "abbe/web/event_board.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::web {
namespace {

constexpr std::array<std::string_view, kTopics> kTopicNames{"source",      "status", "live",
                                                            "calibration", "store",  "notice"};

}  // namespace

void EventBoard::post(Topic topic, std::string_view json) {
  const auto i = static_cast<std::size_t>(topic);
  auto text = std::make_shared<const std::string>(
      fmt::format("event: {}\ndata: {}\n\n", kTopicNames.at(i), json));
  {
    const std::lock_guard lock(mutex_);
    ++entries_[i].number;
    entries_[i].text = std::move(text);
  }
  changed_.notify_all();
}

void EventBoard::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  changed_.notify_all();
}

std::optional<std::string> EventBoard::Reader::next(EventBoard& board,
                                                    std::chrono::milliseconds time_out) {
  std::unique_lock lock(board.mutex_);
  board.changed_.wait_for(lock, time_out, [&] {
    return board.closed_ || !std::ranges::equal(board.entries_, seen_, {}, &Entry::number);
  });
  if (board.closed_) return std::nullopt;

  std::string text;
  for (std::size_t i = 0; i < kTopics; ++i) {
    const Entry& entry = board.entries_[i];
    if (entry.number == seen_[i]) continue;
    seen_[i] = entry.number;
    text += *entry.text;
  }
  return text;
}

}  // namespace abbe::web
