#pragma once
/// The contents of a recording, complete or damaged. They are found by its indexes. If the indexes
/// are incomplete (MCAP does not require them), all records are read from the front.

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
  std::uint64_t offset = 0;  ///< position of its first record in the file
  std::uint64_t size = 0;
  std::uint64_t earliest_ns = 0;  ///< earliest time in this chunk and all chunks after it
  std::uint64_t last_time_ns = 0;
  std::uint64_t messages = 0;
};

struct Contents {
  std::map<std::uint16_t, std::string> topics;  ///< topic by channel
  std::vector<ReadableChunk> chunks;            ///< chunks with at least one message, in file order
  std::map<std::string, std::map<std::string, std::string>> metadata;
  std::vector<RecordingAttachment> attachments;
  std::vector<RecordingLoss> losses;
  std::uint64_t messages = 0;
  /// compression of the first compressed chunk; empty: no chunk is compressed
  std::string compression;
  bool closed_cleanly = false;
};

/// Reads the contents. Accepts any bytes after the MCAP magic. Precondition: the bytes start with
/// the magic. Bytes that cannot be read are missing in the contents; `file.intact()` is then an
/// Error. If `stopped`, which may be empty, returns true, the rest of the file is not read, and the
/// contents must not be used.
[[nodiscard]] Contents contents_of(const RecordedBytes& file, const std::function<bool()>& stopped);

}  // namespace abbe::daemon::recording
