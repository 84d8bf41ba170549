#pragma once

#include <bitset>
#include <string>
#include <string_view>

#include "recording_contents.hpp"

namespace abbe::daemon::recording {

/// Collects the contents of a recording in file order, whether its records were found by the
/// indexes or by reading all of them.
class ContentsCollector {
 public:
  Contents contents;
  bool cut_is_damage = false;  ///< a truncated chunk is damage within the recording

  void lost(std::uint64_t offset, std::uint64_t bytes, std::string what, bool inside = true);
  void add(const protocol::mcap::Channel& channel);
  void add_metadata(protocol::mcap::Bytes content, std::uint64_t offset);
  void add_attachment(protocol::mcap::Bytes content, std::uint64_t offset);
  /// `offset` and `bytes`: position and size of the whole Chunk record in the file; `content`: its
  /// content.
  void add_chunk(const protocol::mcap::ScannedChunk& chunk, protocol::mcap::Bytes content,
                 std::uint64_t offset, std::uint64_t bytes);
  /// Adds the messages and channels among `records`, which begin at `offset` in the file; returns
  /// the number of messages.
  std::uint64_t add_records(protocol::mcap::Bytes records, std::uint64_t offset);
  /// Call it last. `counted`: number of messages in the file according to its statistics.
  [[nodiscard]] Contents finish(std::optional<std::uint64_t> counted);

 private:
  static constexpr std::size_t kChannels = std::size_t{1} << 16;  ///< an ID has 16 bits

  void add_message(const protocol::mcap::Message& message, ReadableChunk& chunk);

  std::size_t chunk_number_ = 0;
  std::bitset<kChannels> used_;  ///< channels with a message
};

}  // namespace abbe::daemon::recording
