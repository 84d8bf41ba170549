#pragma once
/// Builds the bytes of an MCAP file: chunks with their message indexes, and the summary at the end
/// of the file. Sans-I/O: the caller writes the bytes to the file and passes their offsets. No
/// compression, so that a recording is readable up to the last complete record after a power
/// failure. Not thread-safe; allocates only if a buffer exceeds its capacity.
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
  std::uint64_t offset = 0;  ///< offset of the Message record within the chunk's records
};

/// The messages of one channel in a closed chunk.
struct ChannelShare {
  std::uint16_t channel_id = 0;
  std::uint64_t messages = 0;
  /// offset of the channel's MessageIndex, counted from the Chunk's opcode
  std::uint64_t index_offset = 0;
};

/// A chunk with its indexes, to be written in one piece. Views into the builder, valid until its
/// clear().
struct ClosedChunk {
  Bytes bytes;                     ///< Chunk, then one MessageIndex per channel
  std::uint64_t length = 0;        ///< number of these bytes
  std::uint64_t chunk_length = 0;  ///< length of the Chunk record alone
  std::uint64_t records_size = 0;
  std::uint64_t first_time_ns = 0;  ///< 0 without messages
  std::uint64_t last_time_ns = 0;
  std::span<const ChannelShare> shares;
};

/// Collects the records of a chunk. Call add() for each record, then close(), write the bytes to
/// the file, and call clear().
class ChunkBuilder {
 public:
  /// Allocates the memory for `capacity_bytes` of records.
  explicit ChunkBuilder(std::size_t capacity_bytes);

  void add(const Schema& schema);
  void add(const Channel& channel);
  void add(const Message& message);

  [[nodiscard]] bool empty() const noexcept { return records_size() == 0; }
  [[nodiscard]] std::size_t records_size() const noexcept;
  [[nodiscard]] std::uint64_t message_count() const noexcept { return message_count_; }

  /// Completes the chunk with head, checksum and indexes. Do not call add() again before clear().
  [[nodiscard]] ClosedChunk close();
  void clear() noexcept;

 private:
  struct ChannelEntries {
    std::uint16_t channel_id = 0;
    std::vector<IndexEntry> entries;
  };
  [[nodiscard]] std::vector<IndexEntry>& entries_of(std::uint16_t channel_id);
  void append_indexes();

  Buffer buffer_;  ///< head of the chunk, records, and after close() the indexes
  std::vector<ChannelEntries> channels_;
  std::vector<ChannelShare> shares_;
  std::uint64_t message_count_ = 0;
  std::uint64_t first_time_ns_ = 0;
  std::uint64_t last_time_ns_ = 0;
};

/// Collects the offsets of the written records and builds the end of the file from them. Memory:
/// about 100 bytes plus 10 per channel, for each chunk.
class SummaryBuilder {
 public:
  void add(const Schema& schema);
  void add(const Channel& channel);
  /// `offset`: where `chunk` was written in the file.
  void add(const ClosedChunk& chunk, std::uint64_t offset);
  void add(const AttachmentIndex& attachment);
  void add(const MetadataIndex& metadata);

  [[nodiscard]] std::uint64_t message_count() const noexcept { return statistics_.message_count; }

  /// Appends DataEnd (without checksum), summary, summary offsets, Footer and magic.
  /// `data_end_offset` is the offset in the file of the first appended byte.
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
