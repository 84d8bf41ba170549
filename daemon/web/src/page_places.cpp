#include "abbe/web/page_places.hpp"

#include <algorithm>

namespace abbe::web {

PagePlaces::Place PagePlaces::take(const std::string& network, Clock::time_point now, Held& held) {
  const std::lock_guard lock(mutex_);
  if (count(&network) >= most_of_address() && !withdraw_one(&network, now))
    return Place::AllOfAddressTaken;
  if (count(nullptr) >= most_ && !withdraw_one(nullptr, now)) return Place::AllTaken;
  pages_.emplace(++last_number_, Page{network, now + kFirstReport});
  held.number_ = last_number_;
  held.places_ = this;
  return Place::Taken;
}

void PagePlaces::report_reading(std::uint64_t number, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  if (const auto page = pages_.find(number); page != pages_.end())
    page->second.reports_until = now + kNextReport;
}

void PagePlaces::leave(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  pages_.erase(number);
}

bool PagePlaces::is_lost(std::uint64_t number) const {
  const std::lock_guard lock(mutex_);
  const auto page = pages_.find(number);
  return page != pages_.end() && page->second.lost;
}

std::size_t PagePlaces::count(const std::string* network) const {
  return static_cast<std::size_t>(std::ranges::count_if(pages_, [&](const auto& entry) {
    return !entry.second.lost && (network == nullptr || entry.second.network == *network);
  }));
}

bool PagePlaces::withdraw_one(const std::string* network, Clock::time_point now) {
  Page* overdue = nullptr;
  for (auto& [number, page] : pages_) {
    if (page.lost || page.reports_until >= now) continue;
    if (network != nullptr && page.network != *network) continue;
    if (overdue == nullptr || page.reports_until < overdue->reports_until) overdue = &page;
  }
  if (overdue == nullptr) return false;
  overdue->lost = true;
  return true;
}

std::size_t PagePlaces::taken() const {
  const std::lock_guard lock(mutex_);
  return count(nullptr);
}

}  // namespace abbe::web
