#include "abbe/protocol/mcap/crc32.hpp"
#include "abbe/protocol/mcap/records.hpp"
#include "mcap/fields.hpp"

namespace abbe::protocol::mcap {
namespace {

using tl::unexpected;

/// The record, or Truncated if one of its fields is truncated.
template <class T>
Decoded<T> whole(const FieldReader& fields, const T& record) noexcept {
  if (!fields.ok()) return unexpected(DecodeError::Truncated);
  return record;
}

template <class Pairs>
Decoded<Pairs> pairs(Bytes packed) noexcept {
  if (packed.size() % Pairs::kEntrySize != 0) return unexpected(DecodeError::BadMap);
  return Pairs{packed};
}

Decoded<StringMap> string_map(Bytes packed) noexcept {
  FieldReader fields{packed};
  while (fields.ok() && !fields.at_end()) {
    (void)fields.string();
    (void)fields.string();
  }
  if (!fields.ok()) return unexpected(DecodeError::BadMap);
  return StringMap{packed};
}

ChunkHead chunk_head(FieldReader& fields) noexcept {
  ChunkHead head;
  head.first_time_ns = fields.integer<std::uint64_t>();
  head.last_time_ns = fields.integer<std::uint64_t>();
  head.uncompressed_size = fields.integer<std::uint64_t>();
  head.uncompressed_crc = fields.integer<std::uint32_t>();
  head.compression = fields.string();
  head.records_size = fields.integer<std::uint64_t>();
  return head;
}

}  // namespace

std::optional<StringMap::Entry> StringMap::take() noexcept {
  FieldReader fields{bytes_};
  const std::string_view key = fields.string();
  const std::string_view value = fields.string();
  if (!fields.ok()) {
    bytes_ = {};
    return std::nullopt;
  }
  bytes_ = fields.remainder();
  return Entry{key, value};
}

std::optional<std::string_view> StringMap::find(std::string_view key) const noexcept {
  StringMap rest = *this;
  while (const auto entry = rest.take()) {
    if (entry->first == key) return entry->second;
  }
  return std::nullopt;
}

template <>
Decoded<Header> decode<Header>(Bytes content) noexcept {
  FieldReader fields{content};
  Header record;
  record.profile = fields.string();
  record.library = fields.string();
  return whole(fields, record);
}

template <>
Decoded<Footer> decode<Footer>(Bytes content) noexcept {
  FieldReader fields{content};
  Footer record;
  record.summary_start = fields.integer<std::uint64_t>();
  record.summary_offset_start = fields.integer<std::uint64_t>();
  record.summary_crc = fields.integer<std::uint32_t>();
  return whole(fields, record);
}

template <>
Decoded<Schema> decode<Schema>(Bytes content) noexcept {
  FieldReader fields{content};
  Schema record;
  record.id = fields.integer<std::uint16_t>();
  record.name = fields.string();
  record.encoding = fields.string();
  record.data = fields.bytes();
  return whole(fields, record);
}

template <>
Decoded<Channel> decode<Channel>(Bytes content) noexcept {
  FieldReader fields{content};
  Channel record;
  record.id = fields.integer<std::uint16_t>();
  record.schema_id = fields.integer<std::uint16_t>();
  record.topic = fields.string();
  record.message_encoding = fields.string();
  const auto metadata = string_map(fields.bytes());
  if (!metadata) return unexpected(metadata.error());
  record.metadata = *metadata;
  return whole(fields, record);
}

template <>
Decoded<Message> decode<Message>(Bytes content) noexcept {
  FieldReader fields{content};
  Message record;
  record.channel_id = fields.integer<std::uint16_t>();
  record.sequence = fields.integer<std::uint32_t>();
  record.log_time_ns = fields.integer<std::uint64_t>();
  record.publish_time_ns = fields.integer<std::uint64_t>();
  record.data = fields.remainder();
  return whole(fields, record);
}

template <>
Decoded<Chunk> decode<Chunk>(Bytes content) noexcept {
  const auto chunk = decode_cut_chunk(content);
  if (chunk && chunk->records.size() < chunk->head.records_size)
    return unexpected(DecodeError::Truncated);
  return chunk;
}

Decoded<Chunk> decode_cut_chunk(Bytes content) noexcept {
  FieldReader fields{content};
  Chunk record;
  record.head = chunk_head(fields);
  if (fields.ok()) record.records = fields.remainder(record.head.records_size);
  return whole(fields, record);
}

template <>
Decoded<MessageIndex> decode<MessageIndex>(Bytes content) noexcept {
  FieldReader fields{content};
  MessageIndex record;
  record.channel_id = fields.integer<std::uint16_t>();
  const auto entries = pairs<decltype(record.entries)>(fields.bytes());
  if (!entries) return unexpected(entries.error());
  record.entries = *entries;
  return whole(fields, record);
}

template <>
Decoded<ChunkIndex> decode<ChunkIndex>(Bytes content) noexcept {
  FieldReader fields{content};
  ChunkIndex record;
  record.first_time_ns = fields.integer<std::uint64_t>();
  record.last_time_ns = fields.integer<std::uint64_t>();
  record.chunk_start = fields.integer<std::uint64_t>();
  record.chunk_length = fields.integer<std::uint64_t>();
  const auto offsets = pairs<decltype(record.index_offsets)>(fields.bytes());
  if (!offsets) return unexpected(offsets.error());
  record.index_offsets = *offsets;
  record.index_length = fields.integer<std::uint64_t>();
  record.compression = fields.string();
  record.compressed_size = fields.integer<std::uint64_t>();
  record.uncompressed_size = fields.integer<std::uint64_t>();

  return whole(fields, record);
}

template <>
Decoded<Attachment> decode<Attachment>(Bytes content) noexcept {
  FieldReader fields{content};
  Attachment record;
  record.log_time_ns = fields.integer<std::uint64_t>();
  record.create_time_ns = fields.integer<std::uint64_t>();
  record.name = fields.string();
  record.media_type = fields.string();
  record.data = fields.long_bytes();
  const Bytes checked = content.first(content.size() - fields.left());
  const auto crc = fields.integer<std::uint32_t>();
  if (fields.ok() && crc != 0 && crc != crc32(checked)) return unexpected(DecodeError::BadCrc);
  return whole(fields, record);
}

template <>
Decoded<AttachmentIndex> decode<AttachmentIndex>(Bytes content) noexcept {
  FieldReader fields{content};
  AttachmentIndex record;
  record.offset = fields.integer<std::uint64_t>();
  record.length = fields.integer<std::uint64_t>();
  record.log_time_ns = fields.integer<std::uint64_t>();
  record.create_time_ns = fields.integer<std::uint64_t>();
  record.data_size = fields.integer<std::uint64_t>();
  record.name = fields.string();
  record.media_type = fields.string();
  return whole(fields, record);
}

template <>
Decoded<Statistics> decode<Statistics>(Bytes content) noexcept {
  FieldReader fields{content};
  Statistics record;
  record.message_count = fields.integer<std::uint64_t>();
  record.schema_count = fields.integer<std::uint16_t>();
  record.channel_count = fields.integer<std::uint32_t>();
  record.attachment_count = fields.integer<std::uint32_t>();
  record.metadata_count = fields.integer<std::uint32_t>();
  record.chunk_count = fields.integer<std::uint32_t>();
  record.first_time_ns = fields.integer<std::uint64_t>();
  record.last_time_ns = fields.integer<std::uint64_t>();
  const auto counts = pairs<decltype(record.channel_message_counts)>(fields.bytes());
  if (!counts) return unexpected(counts.error());
  record.channel_message_counts = *counts;

  return whole(fields, record);
}

template <>
Decoded<Metadata> decode<Metadata>(Bytes content) noexcept {
  FieldReader fields{content};
  Metadata record;
  record.name = fields.string();
  const auto entries = string_map(fields.bytes());
  if (!entries) return unexpected(entries.error());
  record.entries = *entries;
  return whole(fields, record);
}

template <>
Decoded<MetadataIndex> decode<MetadataIndex>(Bytes content) noexcept {
  FieldReader fields{content};
  MetadataIndex record;
  record.offset = fields.integer<std::uint64_t>();
  record.length = fields.integer<std::uint64_t>();
  record.name = fields.string();
  return whole(fields, record);
}

template <>
Decoded<SummaryOffset> decode<SummaryOffset>(Bytes content) noexcept {
  FieldReader fields{content};
  SummaryOffset record;
  record.group = static_cast<Opcode>(fields.integer<std::uint8_t>());
  record.start = fields.integer<std::uint64_t>();
  record.length = fields.integer<std::uint64_t>();
  return whole(fields, record);
}

template <>
Decoded<DataEnd> decode<DataEnd>(Bytes content) noexcept {
  FieldReader fields{content};
  DataEnd record;
  record.data_section_crc = fields.integer<std::uint32_t>();
  return whole(fields, record);
}

}  // namespace abbe::protocol::mcap
