#include "recording_contents.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::daemon::recording {
namespace {

namespace mcap = protocol::mcap;
using ChunkState = mcap::ScannedChunk::State;

std::map<std::string, std::string> owned(mcap::StringMap entries) {
  std::map<std::string, std::string> map;
  while (const auto entry = entries.take()) map.emplace(entry->first, entry->second);
  return map;
}

/// Collects the contents in file order, whether found by the summary or by reading all records.
class Collector {
 public:
  Contents contents;
  bool cut_is_damage = false;  ///< a truncated chunk is damage within the recording

  void lost(std::uint64_t offset, std::uint64_t bytes, std::string what, bool inside = true) {
    contents.losses.push_back({offset, bytes, std::move(what), inside});
  }
  void add(const mcap::Channel& channel) { contents.topics.emplace(channel.id, channel.topic); }

  void add_metadata(const mcap::Record& record) {
    const auto metadata = mcap::decode<mcap::Metadata>(record.content);
    if (!metadata) return lost_record(record, "metadata cannot be decoded");
    contents.metadata.emplace(metadata->name, owned(metadata->entries));
  }
  void add_attachment(const mcap::Record& record) {
    const auto attachment = mcap::decode<mcap::Attachment>(record.content);
    if (!attachment) return lost_record(record, "an attachment is damaged");
    const std::string_view text{reinterpret_cast<const char*>(attachment->data.data()),
                                attachment->data.size()};
    contents.attachments.push_back(
        {std::string(attachment->name), std::string(attachment->media_type), std::string(text)});
  }

  void add(const mcap::ScannedChunk& chunk, std::uint64_t bytes) {
    ++chunk_number_;
    const auto damaged = [&](std::string_view how) {
      lost(chunk.offset, bytes,
           fmt::format("chunk {} at byte {}: {}", chunk_number_, chunk.offset, how),
           chunk.state != ChunkState::Cut || cut_is_damage);
    };

    switch (chunk.state) {
      case ChunkState::Whole:
        read(chunk.chunk.records);
        return;
      case ChunkState::Cut:
        return damaged(fmt::format("cut off by the end of the file after {} whole messages",
                                   read(chunk.chunk.records)));
      case ChunkState::BadCrc:
        return damaged("its checksum is wrong, skipped");
      case ChunkState::Compressed:
        return damaged(
            fmt::format("compressed ({}), which is not supported", chunk.chunk.head.compression));
      case ChunkState::Malformed:
        return damaged("malformed, skipped");
    }
  }

 private:
  void lost_record(const mcap::Record& record, std::string_view what) {
    lost(record.offset, record.end() - record.offset,
         fmt::format("{} at byte {}", what, record.offset));
  }

  std::uint64_t read(mcap::Bytes records) {
    ReadableChunk chunk{records, ~std::uint64_t{0}, 0, 0};
    mcap::MessageReader messages{records};
    while (const auto message = messages.next()) {
      chunk.earliest_ns = std::min(chunk.earliest_ns, message->log_time_ns);
      chunk.last_time_ns = std::max(chunk.last_time_ns, message->log_time_ns);
      ++chunk.messages;
    }
    contents.messages += chunk.messages;
    if (chunk.messages > 0) contents.chunks.push_back(chunk);
    return chunk.messages;
  }

  std::size_t chunk_number_ = 0;
};

void collect_by_summary(mcap::Bytes file, const mcap::Summary& summary, Collector& collector) {
  for (const auto& channel : summary.channels) collector.add(channel);
  for (const auto& index : summary.metadata) {
    const auto record = mcap::record_at(file, index.offset, mcap::Opcode::Metadata);
    if (record && record->end() - record->offset == index.length)
      collector.add_metadata(*record);
    else
      collector.lost(index.offset, index.length, fmt::format("metadata {} is damaged", index.name));
  }

  for (const auto& index : summary.attachments) {
    const auto record = mcap::record_at(file, index.offset, mcap::Opcode::Attachment);
    if (record && record->end() - record->offset == index.length)
      collector.add_attachment(*record);
    else
      collector.lost(index.offset, index.length,
                     fmt::format("attachment {} is damaged", index.name));
  }

  for (const auto& index : summary.chunks) {
    const auto chunk = mcap::chunk_at(file, index.chunk_start);
    const mcap::ScannedChunk damaged{
        ChunkState::Malformed, static_cast<std::size_t>(index.chunk_start), {}};
    collector.add(chunk.value_or(damaged), index.chunk_length);
  }
}

void collect(const mcap::LinearScan::Item& item, Collector& collector) {
  if (item.chunk) return collector.add(*item.chunk, item.record.end() - item.record.offset);
  if (item.record.opcode == mcap::Opcode::Metadata) return collector.add_metadata(item.record);
  if (item.record.opcode == mcap::Opcode::Attachment) return collector.add_attachment(item.record);
  if (item.record.opcode != mcap::Opcode::Channel) return;
  if (const auto channel = mcap::decode<mcap::Channel>(item.record.content))
    collector.add(*channel);
}

/// True if `rest`, the bytes behind the last whole record, is what a killed recorder or a power cut
/// leaves: a truncated record, or zeros.
bool is_truncated_end(mcap::Bytes rest) {
  return rest.front() != std::byte{0} ||
         std::ranges::all_of(rest, [](std::byte b) { return b == std::byte{0}; });
}

void collect_by_scan(mcap::Bytes file, Collector& collector) {
  // The recording ends with the magic, so it was closed: if the records do not continue to this
  // end, they are damaged, not truncated.
  collector.cut_is_damage = mcap::ends_with_magic(file);
  mcap::LinearScan scan{file};
  bool cut_chunk = false;

  while (const auto item = scan.next()) {
    collect(*item, collector);
    cut_chunk = item->chunk && item->chunk->state == ChunkState::Cut;
  }

  const std::size_t end = scan.whole_until();
  collector.contents.closed_cleanly = scan.complete();
  if (scan.complete()) {
    collector.lost(
        end, file.size() - end,
        fmt::format("the indexes at byte {} are damaged: all records were read instead", end),
        false);
  } else if (end < file.size() && !cut_chunk) {
    collector.lost(end, file.size() - end, fmt::format("cut off or damaged from byte {} on", end),
                   collector.cut_is_damage || !is_truncated_end(file.subspan(end)));
  }
}

}  // namespace

Contents contents_of(mcap::Bytes file) {
  Collector collector;
  if (const auto summary = mcap::read_summary(file)) {
    collector.contents.closed_cleanly = true;
    collect_by_summary(file, *summary, collector);
  } else {
    collect_by_scan(file, collector);
  }
  auto& chunks = collector.contents.chunks;
  for (std::size_t i = chunks.size(); i-- > 1;)
    chunks[i - 1].earliest_ns = std::min(chunks[i - 1].earliest_ns, chunks[i].earliest_ns);
  return std::move(collector.contents);  // NOLINT: a member is not moved out by itself
}

}  // namespace abbe::daemon::recording
