#pragma once
/// Closes recordings that a killed recorder left open (NAME.mcap.part), in the same way as the
/// recorder, so that every MCAP reader can read them. Not real-time: a long file is read once from
/// end to end.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct LeftRecording {
  std::filesystem::path file;  ///< present name of the file
  /// number of messages in the index of the file; 0: the file was empty and was removed
  std::uint64_t messages = 0;
  std::string fault;  ///< reason why the file was not closed; empty: it is closed
};

/// Closes the recordings abbe-*.mcap.part in `directory`, except those of the run `running` and
/// those that another process is still writing, which that process has locked.
/// - Every whole message is kept, also those of a truncated chunk. Index and summary are added; the
///   date of the file is kept. The bytes of finished chunks do not change, so the hashes in models
///   stay valid.
/// - A file is left unchanged, with the reason in `fault`, if its sequence of records breaks before
///   the end: a record has a damaged length, and a whole chunk follows that record.
/// - A chunk with a wrong checksum is not checked here; the readers report it.
///
/// Ends early, between two records, once `stop` is set.
[[nodiscard]] Result<std::vector<LeftRecording>> close_left_recordings(
    const std::filesystem::path& directory, const std::string& running,
    const std::atomic<bool>& stop);

}  // namespace abbe::daemon
