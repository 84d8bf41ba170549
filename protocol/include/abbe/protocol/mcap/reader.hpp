#pragma once
/// Reading MCAP, whole or broken, from bytes someone else owns (usually a mapped file): record by
/// record, by linear scan of a file cut anywhere, or through its summary. Total for any bytes. Only
/// read_summary() allocates. No compression: a compressed chunk is yielded and said to be one, its
/// records are not opened. Thread-safe: pure, or state of its own only.

#include <optional>
#include <vector>

#include "abbe/protocol/mcap/records.hpp"

namespace abbe::protocol::mcap {

/// One framed record: where it stands in the bytes given to the reader, and its content.
struct Record {
  Opcode opcode = Opcode::Header;  ///< may be one this program does not know: skip it
  std::size_t offset = 0;          ///< of the opcode
  Bytes content;
  [[nodiscard]] std::size_t end() const noexcept {
    return offset + kRecordHeadSize + content.size();
  }
};

/// Yields framed records until the bytes end. Works on a data section, on a chunk's records, on a
/// summary.
class RecordReader {
 public:
  enum class State : std::uint8_t {
    Reading,
    End,        ///< the bytes ended with a record
    Truncated,  ///< the record at position() passes the end of the bytes
    Garbage,    ///< no record starts at position(): opcode 0 (what a power cut leaves behind)
  };

  explicit RecordReader(Bytes bytes, std::size_t position = 0) noexcept
      : bytes_(bytes), position_(position) {}
  /// The next record; nothing once state() is no longer Reading.
  [[nodiscard]] std::optional<Record> next() noexcept;
  [[nodiscard]] State state() const noexcept { return state_; }
  /// Just after the last record yielded.
  [[nodiscard]] std::size_t position() const noexcept { return position_; }

 private:
  Bytes bytes_;
  std::size_t position_ = 0;
  State state_ = State::Reading;
};

/// Yields the messages of a chunk's records, in file order; other and torn records are passed over.
class MessageReader {
 public:
  explicit MessageReader(Bytes records) noexcept : records_(records) {}
  [[nodiscard]] std::optional<Message> next() noexcept;

 private:
  RecordReader records_;
};

[[nodiscard]] bool starts_with_magic(Bytes file) noexcept;
[[nodiscard]] bool ends_with_magic(Bytes file) noexcept;

/// A chunk as the scan found it.
struct ScannedChunk {
  enum class State : std::uint8_t {
    Whole,  ///< complete, checksum right or not given
    /// the file ends inside: `chunk.records` holds what is there, its last record may be torn
    Cut,
    BadCrc,      ///< complete in length, but not what was written
    Compressed,  ///< cannot be opened here
    Malformed,   ///< the record is there, but it is not a Chunk
  };
  State state = State::Whole;
  std::size_t offset = 0;  ///< of the Chunk's opcode in the file
  Chunk chunk;
};

/// Walks a file from its start, needing neither footer nor summary. Whole chunks survive whatever
/// happened behind them; a cut chunk is handed out with those of its bytes that exist.
class LinearScan {
 public:
  struct Item {
    Record record;  ///< the top-level record (content short if it is a cut chunk)
    std::optional<ScannedChunk> chunk;  ///< set if it is a Chunk
  };

  explicit LinearScan(Bytes file) noexcept;
  /// The next record of the data section; nothing at DataEnd, at the file's end or where it is
  /// broken.
  [[nodiscard]] std::optional<Item> next() noexcept;
  /// True once DataEnd was reached: nothing of the data section is missing.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  /// Where the whole records end: from here on bytes are cut off or garbage unless complete().
  [[nodiscard]] std::size_t whole_until() const noexcept { return records_.position(); }

 private:
  [[nodiscard]] std::optional<Item> cut_chunk() noexcept;

  Bytes file_;
  RecordReader records_;
  bool complete_ = false;
  bool stopped_ = false;
};

enum class SummaryError : std::uint8_t {
  NoMagic,    ///< the file does not begin and end as one that was closed
  NoFooter,   ///< no Footer before the last magic, or one that points outside the file
  NoSummary,  ///< closed, but without a summary
  BadCrc,     ///< the summary is not what was written
  BadRecord,  ///< a record of the summary cannot be decoded, or points outside the data section
};

/// The indexes of a cleanly closed file. Views into the file's bytes.
struct Summary {
  std::vector<Schema> schemas;
  std::vector<Channel> channels;
  std::vector<ChunkIndex> chunks;  ///< in file order
  std::vector<AttachmentIndex> attachments;
  std::vector<MetadataIndex> metadata;
  std::optional<Statistics> statistics;
};

[[nodiscard]] tl::expected<Summary, SummaryError> read_summary(Bytes file);

/// The record an index points to; nothing if none of that kind starts there.
[[nodiscard]] std::optional<Record> record_at(Bytes file, std::uint64_t offset,
                                              Opcode expected) noexcept;
/// The chunk at `offset` of a file, checked like one met by a scan.
[[nodiscard]] std::optional<ScannedChunk> chunk_at(Bytes file, std::uint64_t offset) noexcept;

}  // namespace abbe::protocol::mcap
