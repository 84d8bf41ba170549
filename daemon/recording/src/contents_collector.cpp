#include "contents_collector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::daemon::recording {
namespace {

namespace mcap = protocol::mcap;
using ChunkState = mcap::ScannedChunk::State;

std::map<std::string, std::string> owned(mcap::StringMap entries) {
  std::map<std::string, std::string> map;
  while (const auto entry = entries.take()) map.emplace(entry->first, entry->second);
  return map;
}

}  // namespace

void ContentsCollector::lost(std::uint64_t offset, std::uint64_t bytes, std::string what,
                             bool inside) {
  contents.losses.push_back({offset, bytes, std::move(what), inside});
}

void ContentsCollector::add(const mcap::Channel& channel) {
  contents.topics.emplace(channel.id, channel.topic);
}

void ContentsCollector::add_metadata(mcap::Bytes content, std::uint64_t offset) {
  const auto metadata = mcap::decode<mcap::Metadata>(content);
  if (!metadata)
    return lost(offset, content.size(),
                fmt::format("metadata cannot be decoded at byte {}", offset));
  contents.metadata.emplace(metadata->name, owned(metadata->entries));
}

void ContentsCollector::add_attachment(mcap::Bytes content, std::uint64_t offset) {
  const auto attachment = mcap::decode<mcap::Attachment>(content);
  if (!attachment)
    return lost(offset, content.size(), fmt::format("an attachment is damaged at byte {}", offset));
  const std::string_view text{reinterpret_cast<const char*>(attachment->data.data()),
                              attachment->data.size()};
  contents.attachments.push_back(
      {std::string(attachment->name), std::string(attachment->media_type), std::string(text)});
}

void ContentsCollector::add_chunk(const mcap::ScannedChunk& chunk, mcap::Bytes content,
                                  std::uint64_t offset, std::uint64_t bytes) {
  ++chunk_number_;
  const auto damaged = [&](std::string_view how) {
    lost(offset, bytes, fmt::format("chunk {} at byte {}: {}", chunk_number_, offset, how),
         chunk.state != ChunkState::Cut || cut_is_damage);
  };
  const auto add_its_records = [&] {
    const mcap::Bytes records = chunk.chunk.records;
    const auto before = static_cast<std::uint64_t>(records.data() - content.data());
    return add_records(records, offset + mcap::kRecordHeadSize + before);
  };

  switch (chunk.state) {
    case ChunkState::Whole:
      add_its_records();
      return;
    case ChunkState::Cut:
      return damaged(
          fmt::format("cut off by the end of the file after {} whole messages", add_its_records()));
    case ChunkState::BadCrc:
      return damaged("its checksum is wrong, skipped");
    case ChunkState::Compressed:
      if (contents.compression.empty()) contents.compression = chunk.chunk.head.compression;
      return damaged(
          fmt::format("compressed ({}), which is not supported", chunk.chunk.head.compression));
    case ChunkState::Malformed:
      return damaged("malformed, skipped");
  }
}

std::uint64_t ContentsCollector::add_records(mcap::Bytes bytes, std::uint64_t offset) {
  ReadableChunk chunk{offset, bytes.size(), ~std::uint64_t{0}, 0, 0};
  mcap::RecordReader records{bytes};
  while (const auto record = records.next()) {
    if (record->opcode == mcap::Opcode::Message) {
      if (const auto message = mcap::decode<mcap::Message>(record->content))
        add_message(*message, chunk);
    } else if (record->opcode == mcap::Opcode::Channel) {
      if (const auto channel = mcap::decode<mcap::Channel>(record->content)) add(*channel);
    }
  }
  contents.messages += chunk.messages;
  if (chunk.messages > 0) contents.chunks.push_back(chunk);
  return chunk.messages;
}

void ContentsCollector::add_message(const mcap::Message& message, ReadableChunk& chunk) {
  chunk.earliest_ns = std::min(chunk.earliest_ns, message.log_time_ns);
  chunk.last_time_ns = std::max(chunk.last_time_ns, message.log_time_ns);
  used_[message.channel_id] = true;
  ++chunk.messages;
}

Contents ContentsCollector::finish(std::optional<std::uint64_t> counted) {
  std::bitset<kChannels> not_described = used_;
  for (const auto& topic : contents.topics) not_described.reset(topic.first);
  for (std::size_t channel = 0; not_described.any(); not_described.reset(channel++))
    if (not_described.test(channel))
      lost(0, 0, fmt::format("channel {} is not described: its messages are skipped", channel));
  if (contents.losses.empty() && counted && *counted != contents.messages)
    lost(0, 0,
         fmt::format("{} messages found, but the statistics of the file count {}",
                     contents.messages, *counted));

  auto& chunks = contents.chunks;
  for (std::size_t i = chunks.size(); i-- > 1;)
    chunks[i - 1].earliest_ns = std::min(chunks[i - 1].earliest_ns, chunks[i].earliest_ns);
  return std::move(contents);
}

}  // namespace abbe::daemon::recording
