#pragma once
/// The addresses of [notify], checked before libcurl reads them. Pure, thread-safe.

#include <optional>
#include <string>
#include <string_view>

#include "abbe/config/notify_config.hpp"

namespace abbe::daemon {

/// Parts of SCHEME://AUTHORITY/PATH; they refer to the text.
struct NotifyUrl {
  std::string_view scheme, authority, host;
  std::string_view path;  ///< the rest, with "/", "?" or "#"
  [[nodiscard]] bool has_user() const;
  [[nodiscard]] bool stays_on_this_computer() const;
};

/// nullopt for a text with characters that are not visible ASCII, without a host, or with a port
/// that is not a number.
[[nodiscard]] std::optional<NotifyUrl> notify_url(std::string_view url);

/// Why `mail.server` cannot be used; empty: it can.
[[nodiscard]] std::string mail_server_fault(const NotifyMail& mail);

}  // namespace abbe::daemon
