#pragma once
/// Structured log lines. Under systemd they go to the journal in its native protocol, with their
/// fields; elsewhere to stderr, as text with the same content. Not for real-time threads.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Values of syslog(3).
enum class Urgency { Error = 3, Warning = 4, Notice = 5, Info = 6 };

struct JournalField {
  std::string name;  ///< "ABBE_DEVICE"
  std::string value;
};

struct JournalEntry {
  Urgency urgency = Urgency::Info;
  std::string message;          ///< text: what happened, where, and what to do
  std::string_view message_id;  ///< 32 hexadecimal digits, the same for every line of its kind
  std::vector<JournalField> fields = {};
};

class JournalSink {
 public:
  virtual ~JournalSink() = default;
  virtual void write(const JournalEntry& entry) = 0;
};

/// Writes systemd's JOURNAL_NATIVE_PROTOCOL: one datagram per entry. An entry that the journal does
/// not accept within 50 ms is lost; the next entry states how many were lost. An Error if no
/// process listens at `socket`.
[[nodiscard]] Result<std::unique_ptr<JournalSink>> native_journal(
    const std::filesystem::path& socket = "/run/systemd/journal/socket");

/// Writes lines "abbed: MESSAGE [ABBE_DEVICE=tracker ...]". A control character, which a device may
/// have sent, is written as an escape: "\u{1B}". `stream` must outlive the sink.
[[nodiscard]] std::unique_ptr<JournalSink> text_journal(std::FILE* stream);

/// The journal if this process's stderr is connected to it (JOURNAL_STREAM, systemd.exec(5)), else
/// stderr.
[[nodiscard]] std::unique_ptr<JournalSink> open_journal();

}  // namespace abbe::daemon
