#pragma once
/// Reads MCAP files, complete or damaged, from bytes owned by the caller (usually a mapped file):
/// record by record, by a linear scan of a truncated file, or by the summary. Accepts any bytes.
/// Only read_summary() allocates. No compression: a compressed chunk is returned with
/// State::Compressed, its records are not decoded. Thread-safe: functions are pure, each object has
/// only its own state.

#include <optional>
#include <vector>

#include "abbe/protocol/mcap/records.hpp"

namespace abbe::protocol::mcap {

/// One record: its offset in the bytes given to the reader, and its content.
struct Record {
  Opcode opcode = Opcode::Header;  ///< may be an unknown opcode: skip the record
  std::size_t offset = 0;          ///< offset of the opcode
  Bytes content;
  [[nodiscard]] std::size_t end() const noexcept {
    return offset + kRecordHeadSize + content.size();
  }
};

/// Returns the records one by one until the bytes end. The bytes may be a data section, the records
/// of a chunk, or a summary.
class RecordReader {
 public:
  enum class State : std::uint8_t {
    Reading,
    End,        ///< the bytes end at the end of a record
    Truncated,  ///< the record at position() extends beyond the end of the bytes
    Garbage,    ///< no record at position(): opcode 0 (zeros after a power failure)
  };

  explicit RecordReader(Bytes bytes, std::size_t position = 0) noexcept
      : bytes_(bytes), position_(position) {}
  /// The next record; nullopt if state() is not Reading.
  [[nodiscard]] std::optional<Record> next() noexcept;
  [[nodiscard]] State state() const noexcept { return state_; }
  /// Offset of the end of the last returned record.
  [[nodiscard]] std::size_t position() const noexcept { return position_; }

 private:
  Bytes bytes_;
  std::size_t position_ = 0;
  State state_ = State::Reading;
};

/// Returns the messages among the records of a chunk, in file order; other and damaged records are
/// skipped.
class MessageReader {
 public:
  explicit MessageReader(Bytes records) noexcept : records_(records) {}
  [[nodiscard]] std::optional<Message> next() noexcept;

 private:
  RecordReader records_;
};

[[nodiscard]] bool starts_with_magic(Bytes file) noexcept;
[[nodiscard]] bool ends_with_magic(Bytes file) noexcept;

/// A chunk found by a scan, and its state.
struct ScannedChunk {
  enum class State : std::uint8_t {
    Whole,  ///< complete; the checksum is correct or absent
    /// the file ends within the chunk: `chunk.records` has the bytes that exist, and its last
    /// record may be incomplete
    Cut,
    BadCrc,      ///< complete in length, but the checksum is wrong
    Compressed,  ///< compressed chunks are not supported
    Malformed,   ///< the content of the record is not a valid Chunk
  };
  State state = State::Whole;
  std::size_t offset = 0;  ///< offset of the Chunk's opcode in the file
  Chunk chunk;
};

/// Reads a file from its start, without footer or summary. All complete chunks before a damaged
/// part are returned; a truncated chunk is returned with its existing bytes.
class LinearScan {
 public:
  struct Item {
    Record record;  ///< the top-level record; the content of a cut chunk is shortened
    std::optional<ScannedChunk> chunk;  ///< set if it is a Chunk
  };

  explicit LinearScan(Bytes file) noexcept;
  /// The next record of the data section; nullopt at DataEnd, at the end of the file, or at damaged
  /// bytes.
  [[nodiscard]] std::optional<Item> next() noexcept;
  /// True once DataEnd was reached: the data section is complete.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  /// Offset of the end of the complete records. Unless complete(), the bytes after it are damaged
  /// or missing.
  [[nodiscard]] std::size_t whole_until() const noexcept { return records_.position(); }

 private:
  [[nodiscard]] std::optional<Item> cut_chunk() noexcept;

  Bytes file_;
  RecordReader records_;
  bool complete_ = false;
  bool stopped_ = false;
};

enum class SummaryError : std::uint8_t {
  NoMagic,    ///< no magic bytes at the beginning or the end: the file was not closed
  NoFooter,   ///< no Footer before the last magic, or a Footer that points outside the file
  NoSummary,  ///< closed, but without a summary
  BadCrc,     ///< the checksum of the summary is wrong
  BadRecord,  ///< a record of the summary cannot be decoded, or points outside the data section
};

/// The indexes of a correctly closed file. Views into the bytes of the file.
struct Summary {
  std::vector<Schema> schemas;
  std::vector<Channel> channels;
  std::vector<ChunkIndex> chunks;  ///< in file order
  std::vector<AttachmentIndex> attachments;
  std::vector<MetadataIndex> metadata;
  std::optional<Statistics> statistics;
};

[[nodiscard]] tl::expected<Summary, SummaryError> read_summary(Bytes file);
/// Same as the function above, for the end of a file. `tail`: the bytes from the offset `begin` to
/// the end of the file; it must contain the bytes from summary_start on, which read_footer()
/// returns. The result contains views into `tail`.
[[nodiscard]] tl::expected<Summary, SummaryError> read_summary(Bytes tail, std::uint64_t begin);
/// The footer; for `tail` the last kLeastTail bytes of the file are enough.
[[nodiscard]] tl::expected<Footer, SummaryError> read_footer(Bytes tail,
                                                             std::uint64_t begin) noexcept;
inline constexpr std::size_t kLeastTail = kFooterRecordSize + kMagic.size();

/// The head of a record: its content of `length` bytes follows.
struct RecordHead {
  Opcode opcode = Opcode::Header;
  std::uint64_t length = 0;
};
/// The head at the beginning of `bytes`; nullopt if there are fewer than kRecordHeadSize bytes, or
/// opcode 0, which is no record.
[[nodiscard]] std::optional<RecordHead> read_head(Bytes bytes) noexcept;

/// The record at the offset of an index; nullopt if no record with opcode `expected` starts there.
[[nodiscard]] std::optional<Record> record_at(Bytes file, std::uint64_t offset,
                                              Opcode expected) noexcept;
/// The chunk at `offset` of a file, checked as LinearScan does.
[[nodiscard]] std::optional<ScannedChunk> chunk_at(Bytes file, std::uint64_t offset) noexcept;

}  // namespace abbe::protocol::mcap
