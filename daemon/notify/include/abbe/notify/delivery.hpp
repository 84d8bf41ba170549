#pragma once
/// Sends notifications to one receiver on a separate thread, so that a receiver that does not
/// answer delays no other. Thread-safe.

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

#include "abbe/notify/delivery_queue.hpp"
#include "abbe/notify/receiver.hpp"
#include "abbe/notify/transfer.hpp"

namespace abbe::notify {

struct DeliveryOptions {
  DeliveryPauses pauses = {};
  TransferLimits limits = {};
  std::size_t most_waiting = DeliveryQueue::kMostWaiting;
};

class Delivery {
 public:
  /// The log function. It is called on the thread of this receiver.
  using Log = std::function<void(std::string_view line)>;

  Delivery(Receiver receiver, DeliveryOptions options, Log log);
  Delivery(const Delivery&) = delete;
  Delivery& operator=(const Delivery&) = delete;
  /// Returns at once, also while a receiver does not answer. Logs the notifications that were not
  /// delivered.
  ~Delivery();

  void push(Notification notification);  ///< adds a notification; never waits for the receiver

 private:
  void run();
  void finish(const TransferOutcome& outcome);

  Receiver receiver_;
  Log log_;
  Transfer transfer_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  DeliveryQueue queue_;
  bool failing_ = false;  ///< the last attempt failed
  std::thread thread_;
};

}  // namespace abbe::notify
