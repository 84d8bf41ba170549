#include <algorithm>

#include "abbe/protocol/mcap/crc32.hpp"
#include "abbe/protocol/mcap/reader.hpp"

namespace abbe::protocol::mcap {
namespace {

using tl::unexpected;

template <class T>
bool keep(std::vector<T>& kept, Bytes content) {
  const auto record = decode<T>(content);
  if (record) kept.push_back(*record);
  return record.has_value();
}

/// Adds the record to the summary. False if the record cannot be decoded. Opcodes that the summary
/// does not need are ignored.
bool keep(Summary& summary, const Record& record) {
  switch (record.opcode) {
    case Opcode::Schema:
      return keep(summary.schemas, record.content);
    case Opcode::Channel:
      return keep(summary.channels, record.content);
    case Opcode::ChunkIndex:
      return keep(summary.chunks, record.content);
    case Opcode::AttachmentIndex:
      return keep(summary.attachments, record.content);
    case Opcode::MetadataIndex:
      return keep(summary.metadata, record.content);
    case Opcode::Statistics: {
      const auto statistics = decode<Statistics>(record.content);
      if (statistics) summary.statistics = *statistics;
      return statistics.has_value();
    }
    default:
      return true;
  }
}

struct FooterAt {
  Footer footer;
  std::size_t offset = 0;  ///< offset of its opcode in the tail
};

/// `begin`: offset of the tail in the file.
tl::expected<FooterAt, SummaryError> find_footer(Bytes tail, std::uint64_t begin) noexcept {
  if (!ends_with_magic(tail)) return unexpected(SummaryError::NoMagic);
  if (tail.size() < kMagic.size() + kFooterRecordSize) return unexpected(SummaryError::NoFooter);
  const std::size_t offset = tail.size() - kMagic.size() - kFooterRecordSize;
  const auto record = record_at(tail, offset, Opcode::Footer);
  if (!record) return unexpected(SummaryError::NoFooter);
  const auto footer = decode<Footer>(record->content);
  if (!footer || footer->summary_start > begin + offset) return unexpected(SummaryError::NoFooter);
  if (footer->summary_start == 0) return unexpected(SummaryError::NoSummary);
  return FooterAt{*footer, offset};
}

bool crc_is_right(Bytes summary_and_footer, const Footer& footer) noexcept {
  const std::size_t end = summary_and_footer.size() - kMagic.size() - sizeof footer.summary_crc;
  return footer.summary_crc == 0 || footer.summary_crc == crc32(summary_and_footer.first(end));
}

bool chunks_lie_in(const std::vector<ChunkIndex>& chunks, std::uint64_t data_end) noexcept {
  return std::ranges::all_of(chunks, [data_end](const ChunkIndex& chunk) {
    return chunk.chunk_length <= data_end && chunk.chunk_start <= data_end - chunk.chunk_length;
  });
}

}  // namespace

tl::expected<Footer, SummaryError> read_footer(Bytes tail, std::uint64_t begin) noexcept {
  const auto at = find_footer(tail, begin);
  if (!at) return unexpected(at.error());
  return at->footer;
}

tl::expected<Summary, SummaryError> read_summary(Bytes file) {
  if (!starts_with_magic(file)) return unexpected(SummaryError::NoMagic);
  return read_summary(file, 0);
}

tl::expected<Summary, SummaryError> read_summary(Bytes tail, std::uint64_t begin) {
  const auto at = find_footer(tail, begin);
  if (!at) return unexpected(at.error());
  if (at->footer.summary_start < begin) return unexpected(SummaryError::NoFooter);
  const auto start = static_cast<std::size_t>(at->footer.summary_start - begin);
  if (!crc_is_right(tail.subspan(start), at->footer)) return unexpected(SummaryError::BadCrc);
  Summary summary;
  RecordReader records{tail.first(at->offset), start};

  while (const auto record = records.next()) {
    if (!keep(summary, *record)) return unexpected(SummaryError::BadRecord);
  }

  if (records.state() != RecordReader::State::End ||
      !chunks_lie_in(summary.chunks, at->footer.summary_start)) {
    return unexpected(SummaryError::BadRecord);
  }

  std::ranges::sort(summary.chunks, {}, &ChunkIndex::chunk_start);
  return summary;
}

}  // namespace abbe::protocol::mcap
