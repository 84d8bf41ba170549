#pragma once
/// One attempt to send a notification, with libcurl. TLS certificates are always verified, a
/// redirect is not followed, and only the protocols http, https, smtp and smtps are used.

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
  /// Time limit for the whole attempt. Some mail servers wait half a minute before they send a
  /// greeting.
  std::chrono::milliseconds whole = std::chrono::seconds{60};
};

struct TransferOutcome {
  enum class Kind {
    Accepted,
    Refused,  ///< final refusal: HTTP 3xx and 4xx, SMTP 5xx
    Failed,   ///< another attempt may succeed
  };
  Kind kind = Kind::Failed;
  std::string text;  ///< the answer or fault that was observed: "HTTP 500: ..."
};

/// send() must be called by one thread only; stop() may be called by any.
class Transfer {
 public:
  explicit Transfer(TransferLimits limits = {});
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer();

  [[nodiscard]] TransferOutcome send(const Receiver& receiver, const Notification& notification,
                                     std::uint64_t not_delivered);
  /// Ends a running send() at once, and makes all later calls of send() return at once.
  void stop();

 private:
  struct Multi;
  TransferLimits limits_;
  std::atomic<bool> stopping_{false};
  std::unique_ptr<Multi> multi_;
};

}  // namespace abbe::notify
