#include "abbe/protocol/mcap/writer.hpp"

#include <algorithm>
#include <limits>

#include "abbe/protocol/mcap/crc32.hpp"
#include "mcap/fields.hpp"

namespace abbe::protocol::mcap {
namespace {

/// Size of a Chunk record without compression, from opcode to records_size. It is constant, so the
/// buffer has a placeholder for it before the records, and the chunk can be written in one piece
/// without a copy.
constexpr std::size_t kChunkHeadSize = kRecordHeadSize + 8 + 8 + 8 + 4 + 4 + 8;

static_assert(sizeof(IndexEntry) == 16, "index entries are written without padding");

}  // namespace

ChunkBuilder::ChunkBuilder(std::size_t capacity_bytes) {
  // The buffer also holds the indexes. The smallest recorded message has about 100 bytes and its
  // index entry 16, so one quarter more is sufficient.
  buffer_.reserve(kChunkHeadSize + capacity_bytes + capacity_bytes / 4);
  clear();
}

void ChunkBuilder::clear() noexcept {
  buffer_.resize(kChunkHeadSize);  // does not exceed the capacity, so it cannot throw
  for (ChannelEntries& channel : channels_) channel.entries.clear();
  shares_.clear();
  message_count_ = 0;
  first_time_ns_ = 0;
  last_time_ns_ = 0;
}

std::size_t ChunkBuilder::records_size() const noexcept {
  return buffer_.size() - kChunkHeadSize;
}

void ChunkBuilder::add(const Schema& schema) {
  append(buffer_, schema);
}
void ChunkBuilder::add(const Channel& channel) {
  append(buffer_, channel);
}

void ChunkBuilder::add(const Message& message) {
  entries_of(message.channel_id).push_back({message.log_time_ns, records_size()});
  append(buffer_, message);
  first_time_ns_ =
      message_count_ == 0 ? message.log_time_ns : std::min(first_time_ns_, message.log_time_ns);
  last_time_ns_ = std::max(last_time_ns_, message.log_time_ns);
  ++message_count_;
}

std::vector<IndexEntry>& ChunkBuilder::entries_of(std::uint16_t channel_id) {
  const auto known = std::ranges::find(channels_, channel_id, &ChannelEntries::channel_id);
  if (known != channels_.end()) return known->entries;
  return channels_.emplace_back(ChannelEntries{channel_id, {}}).entries;
}

ClosedChunk ChunkBuilder::close() {
  ClosedChunk closed;
  closed.records_size = records_size();
  closed.chunk_length = buffer_.size();
  closed.first_time_ns = first_time_ns_;
  closed.last_time_ns = last_time_ns_;

  Chunk head;
  head.head = {first_time_ns_,
               last_time_ns_,
               closed.records_size,
               crc32(Bytes{buffer_}.subspan(kChunkHeadSize)),
               {},
               closed.records_size};
  Buffer front;
  front.reserve(kChunkHeadSize);
  append(front, head);  // with 0 bytes of records; its two length fields are corrected below
  const std::uint64_t content_size = closed.chunk_length - kRecordHeadSize;
  std::memcpy(&front[1], &content_size, sizeof content_size);
  std::memcpy(&front[kChunkHeadSize - 8], &closed.records_size, sizeof closed.records_size);
  std::ranges::copy(front, buffer_.begin());

  append_indexes();
  closed.bytes = buffer_;
  closed.length = buffer_.size();
  closed.shares = shares_;
  return closed;
}

void ChunkBuilder::append_indexes() {
  for (ChannelEntries& channel : channels_) {
    if (channel.entries.empty()) continue;
    // The messages of a device are usually in order, but this is not guaranteed. Readers may search
    // by time.
    std::ranges::stable_sort(channel.entries, {}, &IndexEntry::log_time_ns);
    shares_.push_back({channel.channel_id, channel.entries.size(), buffer_.size()});
    append(buffer_, MessageIndex{channel.channel_id, decltype(MessageIndex::entries){std::as_bytes(
                                                         std::span{channel.entries})}});
  }
}

void SummaryBuilder::add(const Schema& schema) {
  append(schemas_, schema);
  ++statistics_.schema_count;
}

void SummaryBuilder::add(const Channel& channel) {
  append(channels_, channel);
  ++statistics_.channel_count;
}

void SummaryBuilder::add(const ClosedChunk& chunk, std::uint64_t offset) {
  Buffer index_offsets;
  if (!chunk.shares.empty()) {  // a chunk without messages has no times
    const bool first = statistics_.message_count == 0;
    statistics_.first_time_ns =
        first ? chunk.first_time_ns : std::min(statistics_.first_time_ns, chunk.first_time_ns);
    statistics_.last_time_ns = std::max(statistics_.last_time_ns, chunk.last_time_ns);
  }

  for (const ChannelShare& share : chunk.shares) {
    append_integer(index_offsets, share.channel_id);
    append_integer(index_offsets, offset + share.index_offset);
    channel_message_counts_[share.channel_id] += share.messages;
    statistics_.message_count += share.messages;
  }

  ChunkIndex index;
  index.first_time_ns = chunk.first_time_ns;
  index.last_time_ns = chunk.last_time_ns;
  index.chunk_start = offset;
  index.chunk_length = chunk.chunk_length;
  index.index_offsets = decltype(index.index_offsets){index_offsets};
  index.index_length = chunk.length - chunk.chunk_length;
  index.compressed_size = index.uncompressed_size = chunk.records_size;
  append(chunks_, index);
  ++statistics_.chunk_count;
}

void SummaryBuilder::add(const AttachmentIndex& attachment) {
  append(attachments_, attachment);
  ++statistics_.attachment_count;
}

void SummaryBuilder::add(const MetadataIndex& metadata) {
  append(metadata_, metadata);
  ++statistics_.metadata_count;
}

void SummaryBuilder::append_statistics(Buffer& out) const {
  Buffer counts;
  for (const auto& [channel, count] : channel_message_counts_) {
    append_integer(counts, channel);
    append_integer(counts, count);
  }
  Statistics statistics = statistics_;
  statistics.channel_message_counts = decltype(statistics.channel_message_counts){counts};
  append(out, statistics);
}

void SummaryBuilder::finish(std::uint64_t data_end_offset, Buffer& out) const {
  const std::size_t front = out.size();
  append(out, DataEnd{});
  const auto file_offset = [&] { return data_end_offset + (out.size() - front); };
  const std::size_t summary = out.size();
  const std::uint64_t summary_start = file_offset();

  Buffer offsets;
  const auto group = [&](Opcode opcode, const Buffer& records) {
    if (records.empty()) return;
    append(offsets, SummaryOffset{opcode, file_offset(), records.size()});
    append_raw(out, records);
  };
  Buffer statistics;
  append_statistics(statistics);
  group(Opcode::Schema, schemas_);
  group(Opcode::Channel, channels_);
  group(Opcode::Statistics, statistics);
  group(Opcode::ChunkIndex, chunks_);
  group(Opcode::AttachmentIndex, attachments_);
  group(Opcode::MetadataIndex, metadata_);

  Footer footer{summary_start, file_offset(), 0};
  append_raw(out, offsets);
  append(out, footer);
  const std::size_t crc_field = out.size() - sizeof footer.summary_crc;
  footer.summary_crc = crc32(Bytes{out}.subspan(summary, crc_field - summary));
  std::memcpy(&out[crc_field], &footer.summary_crc, sizeof footer.summary_crc);
  append_magic(out);
}

}  // namespace abbe::protocol::mcap
