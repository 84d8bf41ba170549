#pragma once
/// What is in a recording's bytes, whole or broken: found by its summary, else by walking it from
/// the front.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon::recording {

/// A chunk whose messages can be read; its times are those of its messages, not those its head
/// claims.
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

/// Total. Precondition: the bytes start with the MCAP magic.
[[nodiscard]] Contents contents_of(protocol::mcap::Bytes file);

}  // namespace abbe::daemon::recording
