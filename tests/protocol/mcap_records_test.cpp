#include "abbe/protocol/mcap/records.hpp"

#include <gtest/gtest.h>

#include "abbe/protocol/mcap/reader.hpp"

namespace abbe::protocol::mcap {
namespace {

Bytes record_bytes_of(std::string_view text) {
  return std::as_bytes(std::span{text});
}

/// The only record in a buffer, decoded; it views the buffer.
template <class T>
T only(const Buffer& buffer, Opcode opcode) {
  RecordReader reader{buffer};
  const auto record = reader.next();
  EXPECT_TRUE(record && record->opcode == opcode && record->end() == buffer.size());
  const auto decoded = decode<T>(record->content);
  EXPECT_TRUE(decoded.has_value());
  return decoded.value_or(T{});
}

/// Encoding what was decoded gives the same bytes again.
template <class T>
void expect_round_trip(const T& record, Opcode opcode) {
  Buffer once;
  append(once, record);
  Buffer twice;
  append(twice, only<T>(once, opcode));
  EXPECT_EQ(once, twice);
}

TEST(McapRecords, AHeaderIsLaidOutAsInTheSpecification) {
  Buffer buffer;
  append(buffer, Header{"ros2", "me"});
  const std::string_view expected{"\x01\x0E\0\0\0\0\0\0\0\x04\0\0\0ros2\x02\0\0\0me", 9 + 14};
  EXPECT_TRUE(std::ranges::equal(buffer, record_bytes_of(expected)));
}

TEST(McapRecords, AFooterIsTwentyBytesOfContent) {
  Buffer buffer;
  append(buffer, Footer{0x0102, 0x0304, 0x0A0B0C0D});
  const std::string_view expected{
      "\x02\x14\0\0\0\0\0\0\0\x02\x01\0\0\0\0\0\0\x04\x03\0\0\0\0\0\0\x0D\x0C\x0B\x0A", 29};
  EXPECT_TRUE(std::ranges::equal(buffer, record_bytes_of(expected)));
  EXPECT_EQ(buffer.size(), kFooterRecordSize);
}

TEST(McapRecords, EveryKindSurvivesARoundTrip) {
  Buffer map;
  StringMap::pack(map, "key", "value");
  StringMap::pack(map, "empty", "");
  const Buffer pairs(30, std::byte{7});
  const Buffer entries(32, std::byte{9});
  expect_round_trip(Header{"", "library"}, Opcode::Header);
  expect_round_trip(Schema{3, "a::B", "omgidl", record_bytes_of("struct")}, Opcode::Schema);
  expect_round_trip(Channel{1, 3, "topic", "cdr", StringMap{map}}, Opcode::Channel);
  expect_round_trip(Message{1, 2, 3, 4, record_bytes_of("data")}, Opcode::Message);
  expect_round_trip(Chunk{{1, 2, 4, 5, "", 4}, record_bytes_of("recs")}, Opcode::Chunk);
  expect_round_trip(MessageIndex{1, decltype(MessageIndex::entries){entries}},
                    Opcode::MessageIndex);
  expect_round_trip(
      ChunkIndex{1, 2, 3, 4, decltype(ChunkIndex::index_offsets){pairs}, 5, "lz4", 6, 7},
      Opcode::ChunkIndex);
  expect_round_trip(Attachment{1, 2, "path.csv", "text/csv", record_bytes_of("x_mm")},
                    Opcode::Attachment);
  expect_round_trip(AttachmentIndex{1, 2, 3, 4, 5, "path.csv", "text/csv"},
                    Opcode::AttachmentIndex);
  expect_round_trip(
      Statistics{1, 2, 3, 4, 5, 6, 7, 8, decltype(Statistics::channel_message_counts){pairs}},
      Opcode::Statistics);
  expect_round_trip(Metadata{"name", StringMap{map}}, Opcode::Metadata);
  expect_round_trip(MetadataIndex{1, 2, "name"}, Opcode::MetadataIndex);
  expect_round_trip(SummaryOffset{Opcode::Schema, 1, 2}, Opcode::SummaryOffset);
  expect_round_trip(DataEnd{5}, Opcode::DataEnd);
}

TEST(McapRecords, AMapGivesItsEntriesAndFindsThem) {
  Buffer map;
  StringMap::pack(map, "machine", "M1");
  StringMap::pack(map, "speed", "20");
  StringMap entries{map};
  EXPECT_EQ(entries.find("speed"), "20");
  EXPECT_EQ(entries.find("Speed"), std::nullopt);
  EXPECT_EQ(entries.take(), (StringMap::Entry{"machine", "M1"}));
  EXPECT_EQ(entries.take(), (StringMap::Entry{"speed", "20"}));
  EXPECT_EQ(entries.take(), std::nullopt);
}

TEST(McapRecords, EveryShortenedContentIsRefused) {
  Buffer map;
  StringMap::pack(map, "key", "value");
  Buffer buffer;
  append(buffer, Channel{1, 3, "topic", "cdr", StringMap{map}});
  const Bytes content = Bytes{buffer}.subspan(kRecordHeadSize);
  ASSERT_TRUE(decode<Channel>(content));
  for (std::size_t size = 0; size < content.size(); ++size) {
    EXPECT_FALSE(decode<Channel>(content.first(size))) << size;
  }
}

TEST(McapRecords, FieldsANewerWriterAddsAreSkipped) {
  Buffer buffer;
  append(buffer, Schema{3, "a::B", "omgidl", record_bytes_of("struct")});
  buffer.push_back(std::byte{42});
  const auto schema = decode<Schema>(Bytes{buffer}.subspan(kRecordHeadSize));
  ASSERT_TRUE(schema);
  EXPECT_EQ(schema->name, "a::B");
}

TEST(McapRecords, AMapWhoseLastEntryIsTornIsRefused) {
  Buffer map;
  StringMap::pack(map, "key", "value");
  map.pop_back();
  Buffer buffer;
  append(buffer, Metadata{"name", StringMap{map}});
  const auto metadata = decode<Metadata>(Bytes{buffer}.subspan(kRecordHeadSize));
  ASSERT_FALSE(metadata);
  EXPECT_EQ(metadata.error(), DecodeError::BadMap);
}

TEST(McapRecords, AnAttachmentWithAFlippedBitIsRefused) {
  Buffer buffer;
  append(buffer, Attachment{1, 2, "path.csv", "text/csv", record_bytes_of("x_mm,y_mm,z_mm")});
  buffer[buffer.size() - 8] ^= std::byte{1};
  const auto attachment = decode<Attachment>(Bytes{buffer}.subspan(kRecordHeadSize));
  ASSERT_FALSE(attachment);
  EXPECT_EQ(attachment.error(), DecodeError::BadCrc);
}

}  // namespace
}  // namespace abbe::protocol::mcap
