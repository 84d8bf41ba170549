#pragma once
/// A notification: one or more events of a kind, as JSON for a webhook and as a mail. Pure,
/// thread-safe; allocates.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/notify/event.hpp"

namespace abbe::notify {

struct Notification {
  /// Id of the notification. It is the same in every attempt to deliver it, so that a receiver can
  /// recognise a repetition.
  std::string id{};
  std::string machine{};
  std::string kind{};  ///< a word of the key `events`, or "test"
  Phase phase = Phase::Happened;
  Severity severity = Severity::Info;
  std::string text{};  ///< one line
  std::vector<std::string> subjects{};
  std::string model_id{};
  std::uint64_t session = 0;
  std::uint64_t changes = 1;  ///< number of changes of state that the notification summarises
  bool simulated = false;
  protocol::UtcTime time{};  ///< time of the latest change
};

/// "FAULT mill 7: tracker: connecting; last fault: ...", for receivers that show one text.
/// `not_delivered`: number of notifications lost before this one.
[[nodiscard]] std::string headline(const Notification& notification, std::uint64_t not_delivered);

/// The JSON object of docs/files.md, "Notification of a webhook".
[[nodiscard]] std::string json_of(const Notification& notification, std::uint64_t not_delivered);

struct MailAddresses {
  std::string from{};
  std::vector<std::string> to{};
};

/// The whole mail, RFC 5322, with CRLF line ends. Neither the machine's name nor a text can add a
/// header: the subject is encoded [RFC 2047], the body is base64.
[[nodiscard]] std::string mail_of(const Notification& notification, std::uint64_t not_delivered,
                                  const MailAddresses& addresses);

/// Makes the value of a mail header from `text`. Short printable ASCII is used as it is; other text
/// is written as encoded words [RFC 2047] of at most 75 characters, one per line. Control
/// characters become spaces.
[[nodiscard]] std::string header_text(std::string_view text);

}  // namespace abbe::notify
