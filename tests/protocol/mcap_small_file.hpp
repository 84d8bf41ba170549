#pragma once
/// A small MCAP file with three chunks on two channels, and where its parts lie.

#include <string>
#include <vector>

#include "abbe/protocol/mcap/writer.hpp"

namespace abbe::protocol::mcap {

struct SmallFile {
  static constexpr std::size_t kChunks = 3;
  static constexpr std::size_t kMessagesPerChunk = 5;

  Buffer bytes;
  std::vector<std::size_t> chunk_starts;
  std::vector<std::size_t> chunk_ends;  ///< of the Chunk record, before its indexes
  std::size_t data_end = 0;             ///< of the DataEnd record's first byte

  SmallFile() {
    append_magic(bytes);
    append(bytes, Header{"", "test"});
    SummaryBuilder summary;
    add_streams(summary);
    ChunkBuilder chunk{4096};
    for (std::size_t k = 0; k < kChunks; ++k) add_chunk(k, chunk, summary);
    data_end = bytes.size();
    Buffer end;
    summary.finish(bytes.size(), end);
    bytes.insert(bytes.end(), end.begin(), end.end());
  }

  /// Log time of message `i` of chunk `k`: chunks overlap, and within one they run backwards.
  [[nodiscard]] static std::uint64_t time_of(std::size_t k, std::size_t i) {
    return 1000 + 100 * k - 40 * i;
  }

 private:
  void add_streams(SummaryBuilder& summary) {
    const Schema schema{1, "a::B", "omgidl", {}};
    append(bytes, schema);
    summary.add(schema);
    for (const std::uint16_t id : {std::uint16_t{1}, std::uint16_t{2}}) {
      const Channel channel{id, 1, "topic", "cdr", {}};
      append(bytes, channel);
      summary.add(channel);
    }
  }
  void add_chunk(std::size_t k, ChunkBuilder& chunk, SummaryBuilder& summary) {
    for (std::size_t i = 0; i < kMessagesPerChunk; ++i) {
      const auto channel = static_cast<std::uint16_t>(1 + i % 2);
      const std::string data = "message " + std::to_string(i) + " of chunk " + std::to_string(k);
      chunk.add(Message{channel, static_cast<std::uint32_t>(i), time_of(k, i), time_of(k, i),
                        std::as_bytes(std::span{data})});
    }
    const ClosedChunk closed = chunk.close();
    summary.add(closed, bytes.size());
    chunk_starts.push_back(bytes.size());
    chunk_ends.push_back(bytes.size() + closed.chunk_length);
    bytes.insert(bytes.end(), closed.bytes.begin(), closed.bytes.end());
    chunk.clear();
  }
};

}  // namespace abbe::protocol::mcap
