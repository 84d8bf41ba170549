#pragma once
/// A recording that a killed recorder left open: reads its records and writes its end. The file is
/// read piece by piece, not mapped, because the memory of abbed is locked and a recording may be
/// larger than the memory.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"
#include "abbe/protocol/mcap/writer.hpp"

namespace abbe::daemon::recording {

class LeftFile {
 public:
  /// Opens and locks the file. nullopt if it does not exist any more, or if another process is
  /// still writing it.
  [[nodiscard]] static Result<std::optional<LeftFile>> open(const std::filesystem::path& part);

  /// Finds all whole records of the file. BadInput if it is damaged before its end; Io if `stop`
  /// was set or the file cannot be read.
  [[nodiscard]] Result<void> read(const std::atomic<bool>& stop);
  /// True if the file has neither messages nor attachments.
  [[nodiscard]] bool holds_nothing() const {
    return summary_.message_count() == 0 && !has_attachments_;
  }
  [[nodiscard]] std::uint64_t messages() const { return summary_.message_count(); }

  /// Writes the missing end and syncs the file; the file keeps its date.
  [[nodiscard]] Result<void> write_end();

 private:
  using Bytes = protocol::mcap::Bytes;
  struct Head {
    protocol::mcap::Opcode opcode;
    std::uint64_t offset = 0, length = 0;
    [[nodiscard]] std::uint64_t end() const;
  };
  /// The last chunk read; more of its indexes may follow.
  struct OpenChunk {
    std::uint64_t offset = 0, length = 0;
    protocol::mcap::ChunkHead head;
    std::uint64_t indexed = 0;  ///< number of messages in its indexes
    std::vector<protocol::mcap::ChannelShare> shares;
  };

  LeftFile(FileDescriptor fd, std::filesystem::path part, std::uint64_t size,
           struct timespec written);
  [[nodiscard]] Result<std::vector<std::byte>> bytes(std::uint64_t offset,
                                                     std::uint64_t length) const;
  [[nodiscard]] Result<std::optional<Head>> head_at(std::uint64_t offset) const;
  [[nodiscard]] Result<void> take(const Head& record);
  [[nodiscard]] Result<void> take_chunk(const Head& record);
  void take_index(const Head& record, Bytes content);
  void take_metadata(const Head& record, Bytes content);
  void take_attachment(const Head& record, Bytes content);
  void end_chunk();
  [[nodiscard]] Result<void> judge_tail();
  [[nodiscard]] Result<bool> is_zero_from(std::uint64_t offset) const;
  [[nodiscard]] Result<void> judge_last_chunk();
  void rebuild(std::uint64_t offset, Bytes records);
  [[nodiscard]] Result<void> write(std::uint64_t offset, Bytes piece);
  [[nodiscard]] Error io_error(const char* verb) const;

  FileDescriptor fd_;
  std::filesystem::path part_;
  std::uint64_t size_ = 0;
  struct timespec written_;
  protocol::mcap::SummaryBuilder summary_;
  bool has_attachments_ = false;
  bool complete_ = false;  ///< the end is already written; only the file still has to be renamed
  std::uint64_t whole_until_ = 0;
  std::optional<OpenChunk> chunk_;
  protocol::mcap::Buffer rebuilt_;  ///< the last chunk, rebuilt; it will be written at rebuilt_at_
  std::uint64_t rebuilt_at_ = 0;
};

}  // namespace abbe::daemon::recording
