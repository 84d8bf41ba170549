#include "abbe/protocol/mcap/crc32.hpp"
#include "abbe/protocol/mcap/records.hpp"
#include "mcap/fields.hpp"

namespace abbe::protocol::mcap {

void StringMap::pack(Buffer& buffer, std::string_view key, std::string_view value) {
  append_string(buffer, key);
  append_string(buffer, value);
}

void append_magic(Buffer& buffer) {
  append_raw(buffer, kMagic);
}

void append(Buffer& buffer, const Header& record) {
  const RecordScope scope{buffer, Opcode::Header};
  append_string(buffer, record.profile);
  append_string(buffer, record.library);
}

void append(Buffer& buffer, const Footer& record) {
  const RecordScope scope{buffer, Opcode::Footer};
  append_integer(buffer, record.summary_start);
  append_integer(buffer, record.summary_offset_start);
  append_integer(buffer, record.summary_crc);
}

void append(Buffer& buffer, const Schema& record) {
  const RecordScope scope{buffer, Opcode::Schema};
  append_integer(buffer, record.id);
  append_string(buffer, record.name);
  append_string(buffer, record.encoding);
  append_bytes(buffer, record.data);
}

void append(Buffer& buffer, const Channel& record) {
  const RecordScope scope{buffer, Opcode::Channel};
  append_integer(buffer, record.id);
  append_integer(buffer, record.schema_id);
  append_string(buffer, record.topic);
  append_string(buffer, record.message_encoding);
  append_bytes(buffer, record.metadata.bytes());
}

void append(Buffer& buffer, const Message& record) {
  const RecordScope scope{buffer, Opcode::Message};
  append_integer(buffer, record.channel_id);
  append_integer(buffer, record.sequence);
  append_integer(buffer, record.log_time_ns);
  append_integer(buffer, record.publish_time_ns);
  append_raw(buffer, record.data);
}

void append(Buffer& buffer, const Chunk& record) {
  const RecordScope scope{buffer, Opcode::Chunk};
  append_integer(buffer, record.head.first_time_ns);
  append_integer(buffer, record.head.last_time_ns);
  append_integer(buffer, record.head.uncompressed_size);
  append_integer(buffer, record.head.uncompressed_crc);
  append_string(buffer, record.head.compression);
  append_integer(buffer, std::uint64_t{record.records.size()});
  append_raw(buffer, record.records);
}

void append(Buffer& buffer, const MessageIndex& record) {
  const RecordScope scope{buffer, Opcode::MessageIndex};
  append_integer(buffer, record.channel_id);
  append_bytes(buffer, record.entries.bytes());
}

void append(Buffer& buffer, const ChunkIndex& record) {
  const RecordScope scope{buffer, Opcode::ChunkIndex};
  append_integer(buffer, record.first_time_ns);
  append_integer(buffer, record.last_time_ns);
  append_integer(buffer, record.chunk_start);
  append_integer(buffer, record.chunk_length);
  append_bytes(buffer, record.index_offsets.bytes());
  append_integer(buffer, record.index_length);
  append_string(buffer, record.compression);
  append_integer(buffer, record.compressed_size);
  append_integer(buffer, record.uncompressed_size);
}

void append(Buffer& buffer, const Attachment& record) {
  const RecordScope scope{buffer, Opcode::Attachment};
  const std::size_t content = buffer.size();
  append_integer(buffer, record.log_time_ns);
  append_integer(buffer, record.create_time_ns);
  append_string(buffer, record.name);
  append_string(buffer, record.media_type);
  append_integer(buffer, std::uint64_t{record.data.size()});
  append_raw(buffer, record.data);
  append_integer(buffer, crc32(Bytes{buffer}.subspan(content)));
}

void append(Buffer& buffer, const AttachmentIndex& record) {
  const RecordScope scope{buffer, Opcode::AttachmentIndex};
  append_integer(buffer, record.offset);
  append_integer(buffer, record.length);
  append_integer(buffer, record.log_time_ns);
  append_integer(buffer, record.create_time_ns);
  append_integer(buffer, record.data_size);
  append_string(buffer, record.name);
  append_string(buffer, record.media_type);
}

void append(Buffer& buffer, const Statistics& record) {
  const RecordScope scope{buffer, Opcode::Statistics};
  append_integer(buffer, record.message_count);
  append_integer(buffer, record.schema_count);
  append_integer(buffer, record.channel_count);
  append_integer(buffer, record.attachment_count);
  append_integer(buffer, record.metadata_count);
  append_integer(buffer, record.chunk_count);
  append_integer(buffer, record.first_time_ns);
  append_integer(buffer, record.last_time_ns);
  append_bytes(buffer, record.channel_message_counts.bytes());
}

void append(Buffer& buffer, const Metadata& record) {
  const RecordScope scope{buffer, Opcode::Metadata};
  append_string(buffer, record.name);
  append_bytes(buffer, record.entries.bytes());
}

void append(Buffer& buffer, const MetadataIndex& record) {
  const RecordScope scope{buffer, Opcode::MetadataIndex};
  append_integer(buffer, record.offset);
  append_integer(buffer, record.length);
  append_string(buffer, record.name);
}

void append(Buffer& buffer, const SummaryOffset& record) {
  const RecordScope scope{buffer, Opcode::SummaryOffset};
  append_integer(buffer, static_cast<std::uint8_t>(record.group));
  append_integer(buffer, record.start);
  append_integer(buffer, record.length);
}

void append(Buffer& buffer, const DataEnd& record) {
  const RecordScope scope{buffer, Opcode::DataEnd};
  append_integer(buffer, record.data_section_crc);
}

}  // namespace abbe::protocol::mcap
