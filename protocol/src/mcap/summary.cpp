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
  std::size_t offset = 0;  ///< of its opcode
};

tl::expected<FooterAt, SummaryError> find_footer(Bytes file) noexcept {
  if (!starts_with_magic(file) || !ends_with_magic(file)) return unexpected(SummaryError::NoMagic);
  if (file.size() < 2 * kMagic.size() + kFooterRecordSize)
    return unexpected(SummaryError::NoFooter);
  const std::size_t offset = file.size() - kMagic.size() - kFooterRecordSize;
  const auto record = record_at(file, offset, Opcode::Footer);
  if (!record) return unexpected(SummaryError::NoFooter);
  const auto footer = decode<Footer>(record->content);
  if (!footer || footer->summary_start > offset) return unexpected(SummaryError::NoFooter);
  if (footer->summary_start == 0) return unexpected(SummaryError::NoSummary);
  return FooterAt{*footer, offset};
}

bool crc_is_right(Bytes file, const FooterAt& at) noexcept {
  const std::size_t start = static_cast<std::size_t>(at.footer.summary_start);
  const std::size_t end = at.offset + kFooterRecordSize - sizeof at.footer.summary_crc;
  return at.footer.summary_crc == 0 ||
         at.footer.summary_crc == crc32(file.subspan(start, end - start));
}

bool chunks_lie_in(const std::vector<ChunkIndex>& chunks, std::uint64_t data_end) noexcept {
  return std::ranges::all_of(chunks, [data_end](const ChunkIndex& chunk) {
    return chunk.chunk_length <= data_end && chunk.chunk_start <= data_end - chunk.chunk_length;
  });
}

}  // namespace

tl::expected<Summary, SummaryError> read_summary(Bytes file) {
  const auto at = find_footer(file);
  if (!at) return unexpected(at.error());
  if (!crc_is_right(file, *at)) return unexpected(SummaryError::BadCrc);
  Summary summary;
  RecordReader records{file.first(at->offset), static_cast<std::size_t>(at->footer.summary_start)};

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
