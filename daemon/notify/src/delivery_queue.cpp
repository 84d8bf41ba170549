#include "abbe/notify/delivery_queue.hpp"

#include <algorithm>
#include <utility>

namespace abbe::notify {

void DeliveryQueue::push(Notification notification) {
  if (waiting_.size() >= most_waiting_) {
    waiting_.pop_front();
    ++lost_;
  }
  waiting_.push_back(std::move(notification));
}

std::optional<DeliveryQueue::Attempt> DeliveryQueue::take(Time now) {
  if (waiting_.empty() || now < not_before_) return std::nullopt;
  in_transit_ = Attempt{std::move(waiting_.front()), lost_};
  waiting_.pop_front();
  return in_transit_;
}

void DeliveryQueue::accepted() {
  lost_ -= in_transit_->not_delivered;  // notifications lost since take() are not reported yet
  in_transit_.reset();
  pause_ = {};
}

void DeliveryQueue::refused() {
  ++lost_;
  in_transit_.reset();
  pause_ = {};
}

std::chrono::milliseconds DeliveryQueue::failed(Time now) {
  if (waiting_.size() >= most_waiting_)
    ++lost_;  // the notification that failed is the oldest and is dropped
  else
    waiting_.push_front(std::move(in_transit_->notification));
  in_transit_.reset();

  pause_ = pause_.count() == 0 ? pauses_.first : std::min(2 * pause_, pauses_.longest);
  not_before_ = now + pause_;
  return pause_;
}

std::optional<DeliveryQueue::Time> DeliveryQueue::next() const {
  if (waiting_.empty()) return std::nullopt;
  return not_before_;
}

}  // namespace abbe::notify
