#include "abbe/web/password_turns.hpp"

namespace abbe::web {

PasswordTurns::Turn PasswordTurns::wait(const std::string& address, std::size_t failures,
                                        std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  if (waiting_.size() >= kMostWaiting) return {};
  const Waiting own{failures, ++last_number_, address};
  waiting_.insert(own);
  const bool has_turn = changed_.wait_for(lock, patience, [&] { return is_next(own); });
  waiting_.erase(own);
  if (has_turn) checking_.insert(address);
  lock.unlock();
  changed_.notify_all();
  return has_turn ? Turn{*this, address} : Turn{};
}

bool PasswordTurns::is_next(const Waiting& one) const {
  if (checking_.size() >= kAtOnce) return false;
  for (const Waiting& other : waiting_)
    if (!checking_.contains(std::get<2>(other))) return other == one;
  return false;
}

void PasswordTurns::end(const std::string& address) {
  {
    const std::lock_guard lock(mutex_);
    checking_.erase(address);
  }
  changed_.notify_all();
}

}  // namespace abbe::web
