#pragma once
/// The contents of a recording, complete or damaged: found by its indexes, or without complete
/// indexes, which MCAP does not require, by reading all records from the front.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "recorded_bytes.hpp"

namespace abbe::daemon::recording {

/// A part of the file with messages: the records of a chunk, or consecutive records outside of
/// chunks. The times are computed from the messages, not read from the chunk's head, which may be
/// damaged.
struct ReadableChunk {
  std::uint64_t offset = 0;  ///< of its first record in the file
  std::uint64_t size = 0;
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
  std::string compression;  ///< of the first chunk that is compressed; empty: none is
  bool closed_cleanly = false;
};

/// Accepts any bytes after the MCAP magic. Precondition: the bytes start with the magic. Bytes that
/// cannot be read are missing in the contents; `file.intact()` is then an Error. Once `stopped`,
/// which may be empty, returns true, the rest of the file is not read: the contents are not to be
/// used.
[[nodiscard]] Contents contents_of(const RecordedBytes& file, const std::function<bool()>& stopped);

}  // namespace abbe::daemon::recording
