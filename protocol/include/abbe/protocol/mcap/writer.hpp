#pragma once
/// Building the bytes of an MCAP file: chunks with their message indexes, and the summary of a
/// clean close. Sans-I/O: whoever owns the file writes the bytes and says where they went. No
/// compression: a recorder must be readable to the last whole record after a power cut. Not
/// thread-safe; allocates only when a buffer outgrows its capacity.
///
/// File: magic, Header, { Chunk, MessageIndex... | Metadata | Attachment }..., DataEnd, summary,
/// Footer, magic.

#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/protocol/mcap/records.hpp"

namespace abbe::protocol::mcap {

struct IndexEntry {
  std::uint64_t log_time_ns = 0;
  std::uint64_t offset = 0;  ///< of the Message record in the chunk's records
};

/// The messages one channel has in a closed chunk.
struct ChannelShare {
  std::uint16_t channel_id = 0;
  std::uint64_t messages = 0;
  std::uint64_t index_offset = 0;  ///< of its MessageIndex record, from the Chunk's opcode
};

/// A chunk with its indexes, ready to be written in one piece. Views into the builder until its
/// clear().
struct ClosedChunk {
  Bytes bytes;                     ///< Chunk, then one MessageIndex per channel
  std::uint64_t length = 0;        ///< of these bytes
  std::uint64_t chunk_length = 0;  ///< of the Chunk record alone
  std::uint64_t records_size = 0;
  std::uint64_t first_time_ns = 0;  ///< 0 if there are no messages
  std::uint64_t last_time_ns = 0;
  std::span<const ChannelShare> shares;
};

/// Collects records until they are closed into a chunk: add..., close(), write its bytes, clear().
class ChunkBuilder {
 public:
  /// Takes the memory for `capacity_bytes` of records now.
  explicit ChunkBuilder(std::size_t capacity_bytes);

  void add(const Schema& schema);
  void add(const Channel& channel);
  void add(const Message& message);

  [[nodiscard]] bool empty() const noexcept { return records_size() == 0; }
  [[nodiscard]] std::size_t records_size() const noexcept;
  [[nodiscard]] std::uint64_t message_count() const noexcept { return message_count_; }

  /// Writes head, checksum and indexes around the collected records. Nothing may be added before
  /// clear().
  [[nodiscard]] ClosedChunk close();
  void clear() noexcept;

 private:
  struct ChannelEntries {
    std::uint16_t channel_id = 0;
    std::vector<IndexEntry> entries;
  };
  [[nodiscard]] std::vector<IndexEntry>& entries_of(std::uint16_t channel_id);
  void append_indexes();

  Buffer buffer_;  ///< room for the chunk's head, the records, later the indexes
  std::vector<ChannelEntries> channels_;
  std::vector<ChannelShare> shares_;
  std::uint64_t message_count_ = 0;
  std::uint64_t first_time_ns_ = 0;
  std::uint64_t last_time_ns_ = 0;
};

/// Remembers what was written where, and ends the file with it. Holds about 100 bytes + 10 per
/// channel for each chunk.
class SummaryBuilder {
 public:
  void add(const Schema& schema);
  void add(const Channel& channel);
  /// `chunk` was written at `offset` of the file.
  void add(const ClosedChunk& chunk, std::uint64_t offset);
  void add(const AttachmentIndex& attachment);
  void add(const MetadataIndex& metadata);

  [[nodiscard]] std::uint64_t message_count() const noexcept { return statistics_.message_count; }

  /// Appends DataEnd (its checksum not given), summary, summary offsets, Footer and magic.
  /// `data_end_offset` is where in the file the first appended byte will stand.
  void finish(std::uint64_t data_end_offset, Buffer& out) const;

 private:
  void append_statistics(Buffer& out) const;

  Buffer schemas_;
  Buffer channels_;
  Buffer chunks_;
  Buffer attachments_;
  Buffer metadata_;
  Statistics statistics_;
  std::map<std::uint16_t, std::uint64_t> channel_message_counts_;
};

}  // namespace abbe::protocol::mcap
