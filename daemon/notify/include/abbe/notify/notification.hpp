#pragma once
/// What is sent: one or more events of a kind, as JSON for a webhook and as a mail.
/// Pure, thread-safe; allocates.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/notify/event.hpp"

namespace abbe::notify {

struct Notification {
  /// The same in every attempt to deliver it, so that a receiver can recognise a repetition.
  std::string id{};
  std::string machine{};
  std::string kind{};  ///< a word of `events`, or "test"
  Phase phase = Phase::Happened;
  Severity severity = Severity::Info;
  std::string text{};  ///< one line
  std::vector<std::string> subjects{};
  std::string model_id{};
  std::uint64_t session = 0;
  std::uint64_t changes = 1;  ///< how many changes of state it stands for
  bool simulated = false;
  protocol::UtcTime time{};  ///< of the latest change
};

/// "FAULT mill 7: tracker: connecting; last fault: ...", for receivers that show one text.
/// `not_delivered`: notifications before this one that were lost.
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

/// `text` as the value of a header: as it is if it is short printable ASCII, else as encoded words
/// [RFC 2047] of at most 75 characters, on lines of their own. Control characters become spaces.
[[nodiscard]] std::string header_text(std::string_view text);

}  // namespace abbe::notify
