#include "page_places.hpp"

namespace abbe::web {

PagePlaces::Place PagePlaces::take(const std::string& address) {
  const std::lock_guard lock(mutex_);
  if (taken_ >= most_) return Place::AllTaken;
  const auto known = of_address_.find(address);
  if (known != of_address_.end() && known->second >= most_of_address())
    return Place::AllOfAddressTaken;
  ++of_address_[address];
  ++taken_;
  return Place::Taken;
}

void PagePlaces::leave(const std::string& address) {
  const std::lock_guard lock(mutex_);
  --taken_;
  const auto at = of_address_.find(address);
  if (at != of_address_.end() && --at->second == 0) of_address_.erase(at);
}

std::size_t PagePlaces::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

}  // namespace abbe::web
