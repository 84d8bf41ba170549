#include "abbe/notify/delivery.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

namespace abbe::notify {
namespace {

using Clock = std::chrono::steady_clock;
using OutcomeKind = TransferOutcome::Kind;

double seconds_of(std::chrono::milliseconds time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

Delivery::Delivery(Receiver receiver, DeliveryOptions options, Log log)
    : receiver_(std::move(receiver)),
      log_(std::move(log)),
      transfer_(options.limits),
      queue_(options.pauses, options.most_waiting),
      thread_([this] { run(); }) {}

Delivery::~Delivery() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  transfer_.stop();
  changed_.notify_one();
  thread_.join();

  if (const auto lost = queue_.waiting() + queue_.not_delivered(); lost > 0)
    log_(fmt::format("{}: ends; notifications not delivered: {}", receiver_.name, lost));
}

void Delivery::push(Notification notification) {
  {
    const std::lock_guard lock(mutex_);
    queue_.push(std::move(notification));
  }
  changed_.notify_one();
}

void Delivery::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const auto attempt = queue_.take(Clock::now());
    if (attempt) {
      lock.unlock();
      const auto outcome = transfer_.send(receiver_, attempt->notification, attempt->not_delivered);
      lock.lock();
      finish(outcome);
    } else if (const auto next = queue_.next()) {
      changed_.wait_until(lock, *next);
    } else {
      changed_.wait(lock);
    }
  }
}

void Delivery::finish(const TransferOutcome& outcome) {
  if (outcome.kind == OutcomeKind::Accepted) {
    queue_.accepted();
    if (std::exchange(failing_, false)) log_(fmt::format("{}: accepts again", receiver_.name));
    return;
  }

  failing_ = true;
  if (outcome.kind == OutcomeKind::Refused) {
    queue_.refused();
    log_(fmt::format("{}: refused, not sent again: {}", receiver_.name, outcome.text));
    return;
  }
  const auto pause = queue_.failed(Clock::now());
  if (!stopping_)
    log_(fmt::format("{}: not delivered: {}; tried again in {:g} s", receiver_.name, outcome.text,
                     seconds_of(pause)));
}

}  // namespace abbe::notify
