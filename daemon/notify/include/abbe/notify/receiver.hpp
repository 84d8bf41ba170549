#pragma once
/// The receivers of notifications: webhooks and recipients of mails. Each recipient is a separate
/// receiver, so that an address that a mail server refuses does not prevent the mail to the others.
/// A receiver contains the secrets from the files that the configuration names.

#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/notify_config.hpp"

namespace abbe::notify {

struct Webhook {
  std::string url;
  std::string header;  ///< "Authorization: Bearer ..."; empty: none
};

struct Mailbox {
  std::string server;
  bool starttls = true;
  std::string user, password;
  std::string from;
  std::string recipient;
  std::vector<std::string> all_recipients;  ///< for the header To
};

struct Receiver {
  std::string name;  ///< name in messages, without secrets: "webhook 1 (https://hooks.example.com)"
  std::variant<Webhook, Mailbox> way;
  std::filesystem::path ca_file;
};

/// An Error if a file with a secret cannot be used, or if there is no receiver.
[[nodiscard]] daemon::Result<std::vector<Receiver>> receivers_of(
    const daemon::NotifyConfig& config);

}  // namespace abbe::notify
