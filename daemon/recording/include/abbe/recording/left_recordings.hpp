#pragma once
/// Recordings that a killed recorder left open (NAME.mcap.part): closed as it would have closed
/// them, so that every reader finds them whole. For an ordinary thread: a long file is read once
/// from end to end. Ordinary world.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

struct LeftRecording {
  std::filesystem::path file;  ///< as it is called now
  std::uint64_t messages = 0;  ///< in its index; 0: it held nothing and was removed
  std::string fault;           ///< why it stays as it is; empty: it is closed
};

/// Closes what abbed left in `directory` (abbe-*.mcap.part) but what the run `running` writes, and
/// what another process still writes (it holds a lock on it). Every whole message is kept, also
/// those of a chunk that was torn; index and summary are added, the date of the file stays. The
/// bytes of finished chunks do not change, so the hashes in models still hold. A file whose records
/// do not follow each other to its end (one has a damaged length, and a whole chunk stands behind
/// it) stays as it is, with the reason; a chunk with a wrong checksum is for the readers to report.
/// Ends early, between two records, once `stop` is set.
[[nodiscard]] Result<std::vector<LeftRecording>> close_left_recordings(
    const std::filesystem::path& directory, const std::string& running,
    const std::atomic<bool>& stop);

}  // namespace abbe::daemon
