#include "recording_contents.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/result/try.hpp"
#include "contents_collector.hpp"

namespace abbe::daemon::recording {
namespace {

namespace mcap = protocol::mcap;
using mcap::Opcode;
using ChunkState = mcap::ScannedChunk::State;

/// Largest summary, record and truncated chunk that are read; those of abbe have at most some MB. A
/// larger one is treated as a loss: it consists of damaged bytes, or another program made it.
constexpr std::uint64_t kLargestRead = std::uint64_t{256} << 20;
/// Records outside of chunks are kept in pieces of about this size.
constexpr std::uint64_t kLooseBytes = std::uint64_t{1} << 20;

struct PlacedRecord {
  Opcode opcode = Opcode::Header;
  std::uint64_t offset = 0;  ///< position of its opcode in the file
  std::uint64_t length = 0;  ///< length of its content
  [[nodiscard]] std::uint64_t content() const { return offset + mcap::kRecordHeadSize; }
  [[nodiscard]] std::uint64_t end() const { return content() + length; }
};

/// The record at `offset`; nullopt if no whole record is there.
std::optional<PlacedRecord> record_in(ByteWindow& file, std::uint64_t offset) {
  const auto bytes = file.at(offset, mcap::kRecordHeadSize);
  const auto head = bytes ? mcap::read_head(*bytes) : std::nullopt;
  if (!head) return std::nullopt;
  const PlacedRecord record{head->opcode, offset, head->length};
  if (head->length > file.file_size() - record.content()) return std::nullopt;
  return record;
}

/// True if the record is small enough to be read. If not, it is added as a loss.
bool can_be_read(const PlacedRecord& record, ContentsCollector& collector) {
  if (record.length <= kLargestRead) return true;
  collector.lost(record.offset, record.end() - record.offset,
                 fmt::format("a record of {} bytes at byte {} is larger than the {} MiB that are "
                             "read at most: skipped",
                             record.length, record.offset, kLargestRead >> 20));
  return false;
}

/// The chunk of a whole Chunk record, with its content.
mcap::ScannedChunk scanned_chunk(ByteWindow& file, const PlacedRecord& record,
                                 mcap::Bytes& content) {
  const mcap::ScannedChunk malformed{ChunkState::Malformed, 0, {}};
  const auto bytes = file.at(record.offset, mcap::kRecordHeadSize + record.length);
  if (!bytes) return malformed;
  content = bytes->subspan(mcap::kRecordHeadSize);
  return mcap::chunk_at(*bytes, 0).value_or(malformed);
}

void add_whole_chunk(ByteWindow& file, const PlacedRecord& record, ContentsCollector& collector) {
  if (!can_be_read(record, collector)) return;
  mcap::Bytes content;
  const auto chunk = scanned_chunk(file, record, content);
  collector.add_chunk(chunk, content, record.offset, record.end() - record.offset);
}

// --- Contents found by the indexes

/// Content of the record at the place of an index; nullopt if no such record is there.
std::optional<mcap::Bytes> indexed(ByteWindow& file, Opcode opcode, std::uint64_t offset,
                                   std::uint64_t length) {
  const auto record = offset < file.file_size() ? record_in(file, offset) : std::nullopt;
  if (!record || record->opcode != opcode || record->end() - offset != length) return std::nullopt;
  if (record->length > kLargestRead) return std::nullopt;
  return file.at(record->content(), record->length);
}

void collect_by_indexes(ByteWindow& file, const mcap::Summary& summary,
                        const std::function<bool()>& stopped, ContentsCollector& collector) {
  for (const auto& channel : summary.channels) collector.add(channel);
  for (const auto& index : summary.metadata) {
    if (const auto content = indexed(file, Opcode::Metadata, index.offset, index.length))
      collector.add_metadata(*content, index.offset);
    else
      collector.lost(index.offset, index.length,
                     fmt::format("metadata {} is damaged or too large", index.name));
  }

  for (const auto& index : summary.attachments) {
    if (const auto content = indexed(file, Opcode::Attachment, index.offset, index.length))
      collector.add_attachment(*content, index.offset);
    else
      collector.lost(index.offset, index.length,
                     fmt::format("attachment {} is damaged or too large", index.name));
  }

  for (const auto& index : summary.chunks) {
    if (stopped && stopped()) return;
    const auto record = record_in(file, index.chunk_start);
    if (record && record->opcode == Opcode::Chunk)
      add_whole_chunk(file, *record, collector);
    else
      collector.add_chunk({ChunkState::Malformed, 0, {}}, {}, index.chunk_start,
                          index.chunk_length);
  }
}

/// True if the indexes list everything that the statistics count. MCAP requires neither.
bool indexes_are_complete(const mcap::Summary& summary) {
  const auto& counted = summary.statistics;
  const bool channels = counted && summary.channels.size() >= counted->channel_count &&
                        (counted->message_count == 0 || !summary.channels.empty());
  return channels && counted->chunk_count == summary.chunks.size() &&
         counted->metadata_count == summary.metadata.size() &&
         counted->attachment_count == summary.attachments.size();
}

// --- Contents found by reading all records

/// Consecutive records outside of chunks, among them messages.
class LooseRecords {
 public:
  LooseRecords(ByteWindow& file, ContentsCollector& collector)
      : file_(file), collector_(collector) {}
  void add(const PlacedRecord& record) {
    if (end_ != record.offset || end_ - begin_ >= kLooseBytes) finish();
    if (begin_ == end_) begin_ = record.offset;
    end_ = record.end();
  }
  void finish() {
    if (begin_ != end_)
      if (const auto bytes = file_.at(begin_, end_ - begin_))
        collector_.add_records(*bytes, begin_);
    begin_ = end_ = 0;
  }

 private:
  ByteWindow& file_;
  ContentsCollector& collector_;
  std::uint64_t begin_ = 0, end_ = 0;
};

void collect_record(ByteWindow& file, const PlacedRecord& record, LooseRecords& loose,
                    ContentsCollector& collector) {
  const bool is_used = record.opcode == Opcode::Chunk || record.opcode == Opcode::Channel ||
                       record.opcode == Opcode::Message || record.opcode == Opcode::Metadata ||
                       record.opcode == Opcode::Attachment;
  if (is_used && !can_be_read(record, collector)) return;
  switch (record.opcode) {
    case Opcode::Chunk:
      loose.finish();  // this keeps the contents in file order
      return add_whole_chunk(file, record, collector);
    case Opcode::Channel:
    case Opcode::Message:
      return loose.add(record);
    case Opcode::Metadata:
      if (const auto content = file.at(record.content(), record.length))
        collector.add_metadata(*content, record.offset);
      return;
    case Opcode::Attachment:
      if (const auto content = file.at(record.content(), record.length))
        collector.add_attachment(*content, record.offset);
      return;
    default:  // indexes, schemas, and records of later versions of MCAP
      return;
  }
}

/// Collects the chunk at `offset` that the end of the file truncates. False if there is none.
bool collect_cut_chunk(ByteWindow& file, std::uint64_t offset, ContentsCollector& collector) {
  const auto head = file.at(offset, mcap::kRecordHeadSize);
  const auto record = head ? mcap::read_head(*head) : std::nullopt;
  if (!record || record->opcode != Opcode::Chunk) return false;
  const PlacedRecord cut{Opcode::Chunk, offset, file.file_size() - offset - mcap::kRecordHeadSize};
  if (!can_be_read(cut, collector)) return true;
  const auto content = file.at(cut.content(), cut.length);
  const auto chunk = content ? mcap::decode_cut_chunk(*content) : mcap::Decoded<mcap::Chunk>{};
  if (!content || !chunk || !chunk->head.compression.empty()) return false;
  collector.add_chunk({ChunkState::Cut, 0, *chunk}, *content, offset, file.file_size() - offset);
  return true;
}

/// True if the bytes from `offset` to the end of the file are the typical end after a kill or a
/// power cut: a truncated record, or zeros.
bool is_truncated_end(ByteWindow& file, std::uint64_t offset) {
  constexpr std::uint64_t kPiece = 65536;
  const auto first = file.at(offset, 1);
  if (!first || first->empty() || first->front() != std::byte{0}) return true;
  for (; offset < file.file_size(); offset += kPiece) {
    const auto bytes = file.at(offset, kPiece);
    if (!bytes || !std::ranges::all_of(*bytes, [](std::byte b) { return b == std::byte{0}; }))
      return false;
  }
  return true;
}

/// Collects all records and returns the offset of the end of the whole records. Sets closed_cleanly
/// if DataEnd follows.
std::uint64_t collect_records(ByteWindow& file, const std::function<bool()>& stopped,
                              ContentsCollector& collector) {
  LooseRecords loose(file, collector);
  std::uint64_t at = mcap::kMagic.size();
  while (at < file.file_size()) {
    const auto record = record_in(file, at);
    if (!record || (stopped && stopped())) break;
    at = record->end();
    collector.contents.closed_cleanly = record->opcode == Opcode::DataEnd;
    if (collector.contents.closed_cleanly) break;
    collect_record(file, *record, loose, collector);
  }
  loose.finish();
  return at;
}

/// `why`: the reason why the file has no usable indexes; nullopt if it does not need indexes.
void collect_by_scan(ByteWindow& file, std::optional<mcap::SummaryError> why,
                     const std::function<bool()>& stopped, ContentsCollector& collector) {
  // The recording ends with the magic, so it was closed: if the records do not continue to this
  // end, they are damaged, not truncated.
  const auto size = file.file_size();
  const auto last = file.at(size - std::min<std::uint64_t>(size, mcap::kMagic.size()), size);
  collector.cut_is_damage = last && mcap::ends_with_magic(*last);

  const std::uint64_t end = collect_records(file, stopped, collector);
  const bool absent = !why || *why == mcap::SummaryError::NoSummary;
  if (collector.contents.closed_cleanly && !absent) {
    collector.lost(
        end, size - end,
        fmt::format("the indexes at byte {} are damaged: all records were read instead", end),
        false);
  } else if (!collector.contents.closed_cleanly && end < size &&
             !collect_cut_chunk(file, end, collector)) {
    collector.lost(end, size - end, fmt::format("cut off or damaged from byte {} on", end),
                   collector.cut_is_damage || !is_truncated_end(file, end));
  }
}

// --- Both ways

/// The summary of the file. Its views are into `bytes`.
tl::expected<mcap::Summary, mcap::SummaryError> summary_of(const RecordedBytes& file,
                                                           std::vector<std::byte>& bytes) {
  const auto tail_of = [&](std::uint64_t from) {
    bytes.resize(file.size() - from);
    return file.read(from, bytes);
  };
  const std::uint64_t begin = file.size() - std::min<std::uint64_t>(file.size(), mcap::kLeastTail);
  if (!tail_of(begin)) return tl::unexpected(mcap::SummaryError::NoMagic);
  const auto footer = mcap::read_footer(bytes, begin);
  ABBE_TRY(footer);
  if (file.size() - footer->summary_start > kLargestRead || !tail_of(footer->summary_start))
    return tl::unexpected(mcap::SummaryError::BadRecord);
  return mcap::read_summary(bytes, footer->summary_start);
}

}  // namespace

Contents contents_of(const RecordedBytes& file, const std::function<bool()>& stopped) {
  std::vector<std::byte> summary_bytes;
  const auto summary = summary_of(file, summary_bytes);
  std::optional<std::uint64_t> counted;
  if (summary && summary->statistics) counted = summary->statistics->message_count;
  ByteWindow window(file);

  if (summary && indexes_are_complete(*summary)) {
    ContentsCollector collector;
    collector.contents.closed_cleanly = true;
    collect_by_indexes(window, *summary, stopped, collector);
    // Messages outside of chunks have no index.
    if (!collector.contents.losses.empty() || collector.contents.messages == counted)
      return collector.finish(counted);
  }

  ContentsCollector collector;
  if (summary)
    for (const auto& channel : summary->channels) collector.add(channel);
  collect_by_scan(window, summary ? std::nullopt : std::optional(summary.error()), stopped,
                  collector);
  return collector.finish(counted);
}

}  // namespace abbe::daemon::recording
