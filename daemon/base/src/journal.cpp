#include "abbe/base/journal.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <utility>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/base/unix_socket.hpp"
#include "abbe/protocol/printable.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

// Limits the wait for a journal that does not read its socket, so that abbed can still exit.
constexpr std::chrono::milliseconds kJournalSendTimeOut{50};

/// Appends NAME=VALUE. A value with a line break is written as NAME, line feed, the length of the
/// value in 64 bits (little-endian), and the value.
void append_field(std::string& datagram, std::string_view name, std::string_view value) {
  datagram += name;
  if (value.find('\n') == std::string_view::npos) {
    datagram += '=';
  } else {
    datagram += '\n';
    for (int byte = 0; byte < 8; ++byte)
      datagram += static_cast<char>(static_cast<std::uint64_t>(value.size()) >> 8 * byte & 0xff);
  }
  datagram += value;
  datagram += '\n';
}

class NativeJournal final : public JournalSink {
 public:
  explicit NativeJournal(FileDescriptor socket) : socket_(std::move(socket)) {}

  void write(const JournalEntry& entry) override {
    std::string datagram;
    append_field(datagram, "MESSAGE",
                 lost_ == 0 ? entry.message
                            : fmt::format("{}; the journal lost {} entries before this one",
                                          entry.message, lost_));
    append_field(datagram, "PRIORITY", std::to_string(static_cast<int>(entry.urgency)));
    append_field(datagram, "SYSLOG_IDENTIFIER", "abbed");
    append_field(datagram, "MESSAGE_ID", entry.message_id);
    for (const auto& [name, value] : entry.fields) append_field(datagram, name, value);
    if (lost_ > 0) append_field(datagram, "ABBE_NOT_TAKEN", std::to_string(lost_));
    lost_ = ::write(socket_.get(), datagram.data(), datagram.size()) < 0 ? lost_ + 1 : 0;
  }

 private:
  FileDescriptor socket_;
  std::uint64_t lost_ = 0;  ///< consecutive entries lost before the next one
};

class TextJournal final : public JournalSink {
 public:
  explicit TextJournal(std::FILE* stream) : stream_(stream) {}

  void write(const JournalEntry& entry) override {
    std::string line = fmt::format("abbed: {} [", entry.message);
    for (const auto& [name, value] : entry.fields)
      if (name != "ABBE_FAULT")  // the message already contains this field
        line += fmt::format("{}={} ", name, value);
    line.back() = ']';
    line = protocol::printable_line(line) + '\n';
    (void)!std::fwrite(line.data(), 1, line.size(), stream_);
    (void)std::fflush(stream_);
  }

 private:
  std::FILE* stream_;
};

/// JOURNAL_STREAM is "DEVICE:INODE" of the stream that is connected to the journal.
bool stderr_leads_to_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &status) != 0) return false;
  return fmt::format("{}:{}", status.st_dev, status.st_ino) == stream;
}

}  // namespace

Result<std::unique_ptr<JournalSink>> native_journal(const std::filesystem::path& socket) {
  auto connected = connect_unix_datagrams(socket);
  ABBE_TRY(connected);
  set_send_time_out(connected->get(), kJournalSendTimeOut);
  return std::make_unique<NativeJournal>(std::move(*connected));
}

std::unique_ptr<JournalSink> text_journal(std::FILE* stream) {
  return std::make_unique<TextJournal>(stream);
}

std::unique_ptr<JournalSink> open_journal() {
  if (stderr_leads_to_journal())
    if (auto journal = native_journal()) return std::move(*journal);
  return text_journal(stderr);
}

}  // namespace abbe::daemon
