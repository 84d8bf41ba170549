#pragma once
/// Checks the addresses of [notify] before libcurl reads them. Pure, thread-safe.

#include <optional>
#include <string>
#include <string_view>

#include "abbe/config/notify_config.hpp"

namespace abbe::daemon {

/// Parts of SCHEME://AUTHORITY/PATH; they refer to the text.
struct NotifyUrl {
  std::string_view scheme, authority, host;
  std::string_view path;  ///< the rest of the text, beginning with "/", "?" or "#"
  [[nodiscard]] bool has_user() const;
  [[nodiscard]] bool stays_on_this_computer() const;
};

/// The parts of `url`. nullopt if it has characters that are not visible ASCII, has no host, or has
/// a port that is not a number.
[[nodiscard]] std::optional<NotifyUrl> notify_url(std::string_view url);

/// The reason why `mail.server` cannot be used; empty: it can be used.
[[nodiscard]] std::string mail_server_fault(const NotifyMail& mail);

}  // namespace abbe::daemon
