#pragma once
/// The contents of a recording, complete or damaged: found by its summary, or without a summary by
/// reading all records from the front.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon::recording {

/// A chunk whose messages can be read. The times are computed from the messages of the chunk, not
/// read from the chunk's head, which may be damaged.
struct ReadableChunk {
  protocol::mcap::Bytes records;
  std::uint64_t earliest_ns = 0;  ///< of this chunk and all after it
  std::uint64_t last_time_ns = 0;
  std::uint64_t messages = 0;
};

struct Contents {
  std::map<std::uint16_t, std::string> topics;  ///< by channel
  std::vector<ReadableChunk> chunks;            ///< with at least one message, in file order
  std::map<std::string, std::map<std::string, std::string>> metadata;
  std::vector<RecordingAttachment> attachments;
  std::vector<RecordingLoss> losses;
  std::uint64_t messages = 0;
  bool closed_cleanly = false;
};

/// Accepts any bytes after the MCAP magic. Precondition: the bytes start with the magic.
[[nodiscard]] Contents contents_of(protocol::mcap::Bytes file);

}  // namespace abbe::daemon::recording
