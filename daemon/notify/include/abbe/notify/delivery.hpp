#pragma once
/// Sends notifications to one receiver, on a thread of its own: a receiver that hangs delays no
/// other. Thread-safe.

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
  /// Called by the thread of this receiver.
  using Log = std::function<void(std::string_view line)>;

  Delivery(Receiver receiver, DeliveryOptions options, Log log);
  Delivery(const Delivery&) = delete;
  Delivery& operator=(const Delivery&) = delete;
  /// Ends at once, also while the receiver hangs; logs what was not delivered.
  ~Delivery();

  void push(Notification notification);  ///< never waits for the receiver

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
