#include "page_places.hpp"

namespace abbe::web {

PagePlaces::Place PagePlaces::take(const std::string& network, Held& held) {
  held.network_ = network;  // before the place is taken, because it may find no memory
  const std::lock_guard lock(mutex_);
  if (taken_ >= most_) return Place::AllTaken;
  const auto known = of_network_.find(network);
  if (known != of_network_.end() && known->second >= most_of_address())
    return Place::AllOfAddressTaken;
  ++of_network_[network];
  ++taken_;
  held.places_ = this;
  return Place::Taken;
}

void PagePlaces::leave(const std::string& network) {
  const std::lock_guard lock(mutex_);
  --taken_;
  const auto at = of_network_.find(network);
  if (at != of_network_.end() && --at->second == 0) of_network_.erase(at);
}

std::size_t PagePlaces::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

}  // namespace abbe::web
