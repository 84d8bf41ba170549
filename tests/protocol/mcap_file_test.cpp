// Writing and reading whole and broken files.

#include <gtest/gtest.h>

#include <algorithm>

#include "abbe/protocol/mcap/crc32.hpp"
#include "abbe/protocol/mcap/reader.hpp"
#include "mcap_small_file.hpp"

namespace abbe::protocol::mcap {
namespace {

std::size_t count(Bytes records) {
  std::size_t n = 0;
  MessageReader reader{records};
  while (reader.next()) ++n;
  return n;
}

TEST(McapWriter, TheSummaryNamesEveryChunkAndCountsEveryMessage) {
  const SmallFile file;
  const auto summary = read_summary(file.bytes);
  ASSERT_TRUE(summary);
  ASSERT_EQ(summary->chunks.size(), SmallFile::kChunks);

  for (std::size_t k = 0; k < SmallFile::kChunks; ++k) {
    EXPECT_EQ(summary->chunks[k].chunk_start, file.chunk_starts[k]);
    EXPECT_EQ(summary->chunks[k].chunk_start + summary->chunks[k].chunk_length, file.chunk_ends[k]);
  }

  EXPECT_EQ(summary->channels.size(), 2u);
  ASSERT_TRUE(summary->statistics);
  EXPECT_EQ(summary->statistics->message_count, SmallFile::kChunks * SmallFile::kMessagesPerChunk);
  EXPECT_EQ(summary->statistics->first_time_ns, SmallFile::time_of(0, 4));
  EXPECT_EQ(summary->statistics->last_time_ns, SmallFile::time_of(2, 0));
}

TEST(McapWriter, MessageIndexesPointAtTheirMessagesInOrderOfTime) {
  const SmallFile file;
  const auto summary = read_summary(file.bytes);
  ASSERT_TRUE(summary);
  const ChunkIndex& index = summary->chunks[1];
  const auto chunk = chunk_at(file.bytes, index.chunk_start);
  ASSERT_TRUE(chunk);
  std::size_t found = 0;

  for (std::size_t c = 0; c < index.index_offsets.size(); ++c) {
    const auto [channel, offset] = index.index_offsets[c];
    const auto record = record_at(file.bytes, offset, Opcode::MessageIndex);
    ASSERT_TRUE(record);
    const auto messages = decode<MessageIndex>(record->content);
    ASSERT_TRUE(messages);
    std::uint64_t before = 0;

    for (std::size_t i = 0; i < messages->entries.size(); ++i, ++found) {
      const auto [time, at] = messages->entries[i];
      const auto message = record_at(chunk->chunk.records, at, Opcode::Message);
      ASSERT_TRUE(message);
      EXPECT_EQ(decode<Message>(message->content)->log_time_ns, time);
      EXPECT_EQ(decode<Message>(message->content)->channel_id, channel);
      EXPECT_GT(time, before);
      before = time;
    }
  }

  EXPECT_EQ(found, SmallFile::kMessagesPerChunk);
}

TEST(McapWriter, SummaryOffsetsPointAtTheFirstRecordOfEachGroup) {
  const SmallFile file;
  const std::size_t footer_at = file.bytes.size() - kMagic.size() - kFooterRecordSize;
  const auto footer = decode<Footer>(record_at(file.bytes, footer_at, Opcode::Footer)->content);
  ASSERT_TRUE(footer);
  RecordReader offsets{Bytes{file.bytes}.first(footer_at),
                       static_cast<std::size_t>(footer->summary_offset_start)};
  std::size_t groups = 0;

  while (const auto record = offsets.next()) {
    const auto group = decode<SummaryOffset>(record->content);
    ASSERT_TRUE(group);
    EXPECT_TRUE(record_at(file.bytes, group->start, group->group));
    ++groups;
  }

  EXPECT_EQ(groups, 4u);  // schema, channels, statistics, chunk indexes
}

TEST(McapWriter, AClosedChunkLeavesAnEmptyBuilderBehind) {
  ChunkBuilder chunk{1024};
  chunk.add(Message{1, 0, 5, 5, {}});
  const auto first = chunk.close();
  const Buffer bytes{first.bytes.begin(), first.bytes.end()};
  chunk.clear();
  EXPECT_TRUE(chunk.empty());
  chunk.add(Message{1, 0, 5, 5, {}});
  const auto second = chunk.close();
  EXPECT_TRUE(std::ranges::equal(second.bytes, bytes));
}

TEST(McapSummary, IsRefusedWhenAnyOfItsBitsFlipped) {
  const SmallFile file;
  for (std::size_t at = file.data_end + kRecordHeadSize + 4; at < file.bytes.size(); ++at) {
    Buffer flipped = file.bytes;
    flipped[at] ^= std::byte{0x10};
    EXPECT_FALSE(read_summary(flipped)) << "byte " << at;
  }
}

TEST(McapSummary, ThatPointsOutsideTheDataIsRefused) {
  Buffer bytes;
  append_magic(bytes);
  const std::uint64_t start = bytes.size();
  ChunkIndex index;
  index.chunk_start = ~std::uint64_t{0} - 10;
  index.chunk_length = 100;
  append(bytes, index);
  append(bytes, Footer{start, 0, 0});
  append_magic(bytes);
  const auto summary = read_summary(bytes);
  ASSERT_FALSE(summary);
  EXPECT_EQ(summary.error(), SummaryError::BadRecord);
}

TEST(McapScan, OfAFileCutAnywhereGivesEveryFinishedChunkAndTheWholeMessagesOfTheLast) {
  const SmallFile file;
  const std::size_t message_size =
      kRecordHeadSize + 22 + std::string_view("message 0 of chunk 0").size();
  const std::size_t records_at =
      file.chunk_ends[0] - file.chunk_starts[0] - SmallFile::kMessagesPerChunk * message_size;

  for (std::size_t cut = 0; cut <= file.data_end; ++cut) {
    std::size_t expected = 0;
    for (std::size_t k = 0; k < SmallFile::kChunks; ++k) {
      const std::size_t first = file.chunk_starts[k] + records_at;
      if (cut >= first)
        expected += std::min(SmallFile::kMessagesPerChunk, (cut - first) / message_size);
    }
    std::size_t messages = 0;
    LinearScan scan{Bytes{file.bytes}.first(cut)};
    while (const auto item = scan.next()) {
      if (item->chunk) messages += count(item->chunk->chunk.records);
    }
    ASSERT_EQ(messages, expected) << "cut at " << cut;
    ASSERT_FALSE(scan.complete());
    ASSERT_LE(scan.whole_until(), cut);
  }
}

TEST(McapScan, ReportsWhichChunkIsDamagedAndContinuesBehindIt) {
  SmallFile file;
  file.bytes[file.chunk_ends[1] - 5] ^= std::byte{1};
  std::vector<ScannedChunk::State> states;
  LinearScan scan{file.bytes};
  while (const auto item = scan.next()) {
    if (item->chunk) states.push_back(item->chunk->state);
  }
  using enum ScannedChunk::State;
  EXPECT_EQ(states, (std::vector{Whole, BadCrc, Whole}));
  EXPECT_TRUE(scan.complete());
}

TEST(McapScan, StopsWhereAPowerCutLeftZeros) {
  const SmallFile file;
  Buffer bytes{file.bytes.begin(),
               file.bytes.begin() + static_cast<std::ptrdiff_t>(file.chunk_ends[0])};
  bytes.resize(bytes.size() + 4096);
  LinearScan scan{bytes};
  std::size_t chunks = 0;
  while (const auto item = scan.next()) chunks += item->chunk ? 1 : 0;
  EXPECT_EQ(chunks, 1u);
  EXPECT_EQ(scan.whole_until(), file.chunk_ends[0]);
  EXPECT_FALSE(scan.complete());
}

TEST(McapScan, SkipsRecordsOfUnknownKind) {
  const SmallFile file;
  Buffer bytes{file.bytes.begin(), file.bytes.begin() + static_cast<std::ptrdiff_t>(file.data_end)};
  const std::size_t private_record = bytes.size();
  append(bytes, DataEnd{});
  bytes[private_record] = std::byte{0x80};
  append(bytes, DataEnd{});
  LinearScan scan{bytes};
  while (scan.next()) {
  }
  EXPECT_TRUE(scan.complete());
}

TEST(McapScan, ReportsThatACompressedChunkCannotBeOpened) {
  Buffer bytes;
  append_magic(bytes);
  append(bytes, Chunk{{0, 0, 100, 0, "zstd", 0}, {}});
  LinearScan scan{bytes};
  const auto item = scan.next();
  ASSERT_TRUE(item && item->chunk);
  EXPECT_EQ(item->chunk->state, ScannedChunk::State::Compressed);
}

}  // namespace
}  // namespace abbe::protocol::mcap
