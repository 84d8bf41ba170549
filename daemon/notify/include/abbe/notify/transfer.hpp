#pragma once
/// One attempt to send a notification, with libcurl. TLS certificates are always verified, a
/// redirect is not followed, and only http, https, smtp and smtps are spoken.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "abbe/notify/notification.hpp"
#include "abbe/notify/receiver.hpp"

namespace abbe::notify {

struct TransferLimits {
  std::chrono::milliseconds connect = std::chrono::seconds{10};
  /// The whole attempt. Some mail servers wait half a minute before they greet.
  std::chrono::milliseconds whole = std::chrono::seconds{60};
};

struct TransferOutcome {
  enum class Kind {
    Accepted,
    Refused,  ///< for good: HTTP 3xx and 4xx, SMTP 5xx
    Failed,   ///< may succeed later
  };
  Kind kind = Kind::Failed;
  std::string text;  ///< what was seen: "HTTP 500: ..."
};

/// send() is for one thread; stop() for any.
class Transfer {
 public:
  explicit Transfer(TransferLimits limits = {});
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer();

  [[nodiscard]] TransferOutcome send(const Receiver& receiver, const Notification& notification,
                                     std::uint64_t not_delivered);
  /// Ends a send() that is under way, and all later ones, at once.
  void stop();

 private:
  struct Multi;
  TransferLimits limits_;
  std::atomic<bool> stopping_{false};
  std::unique_ptr<Multi> multi_;
};

}  // namespace abbe::notify
