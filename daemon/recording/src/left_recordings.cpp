#include "abbe/recording/left_recordings.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "abbe/result/try.hpp"
#include "left_file.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPart = ".mcap.part";

/// True if `file` belongs to the run `running`: its name is NAME.mcap.part, NAME-2.mcap.part ...,
/// with the NAME of this run.
bool is_written_by(const std::string& file, const std::string& running) {
  return !running.empty() && file.starts_with(running) &&
         (file[running.size()] == '.' || file[running.size()] == '-');
}

Result<std::vector<fs::path>> parts_in(const fs::path& directory, const std::string& running) {
  std::vector<fs::path> parts;
  std::error_code error;
  for (fs::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename();
    if (name.starts_with("abbe-") && name.ends_with(kPart) && !is_written_by(name, running))
      parts.push_back(entry->path());
  }
  if (error)
    return fail(ErrorCode::Io, fmt::format("list {}: {}", directory.string(), error.message()));
  std::sort(parts.begin(), parts.end());
  return parts;
}

/// Renames NAME.mcap.part to NAME.mcap and syncs the directory, as the recorder does.
Result<fs::path> take_finished_name(const fs::path& part) {
  auto finished = part;
  finished.replace_extension();
  if (::renameat2(AT_FDCWD, part.c_str(), AT_FDCWD, finished.c_str(), RENAME_NOREPLACE) != 0)
    return fail(ErrorCode::Io, fmt::format("rename {} to {}: {}", part.string(),
                                           finished.filename().string(), std::strerror(errno)));
  const FileDescriptor directory{
      ::open(part.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (directory) (void)::fsync(directory.get());
  return finished;
}

/// Closes one recording; nullopt if another process is writing it.
Result<std::optional<LeftRecording>> close_one(const fs::path& part,
                                               const std::atomic<bool>& stop) {
  auto file = recording::LeftFile::open(part);
  ABBE_TRY(file);
  if (!*file) return std::nullopt;
  ABBE_TRY((*file)->read(stop));

  if ((*file)->holds_nothing()) {
    if (::unlink(part.c_str()) != 0)
      return fail(ErrorCode::Io, fmt::format("remove {}: {}", part.string(), std::strerror(errno)));
    return LeftRecording{.file = part};
  }

  ABBE_TRY((*file)->write_end());
  auto finished = take_finished_name(part);
  ABBE_TRY(finished);

  return LeftRecording{.file = std::move(*finished), .messages = (*file)->messages()};
}

}  // namespace

Result<std::vector<LeftRecording>> close_left_recordings(const fs::path& directory,
                                                         const std::string& running,
                                                         const std::atomic<bool>& stop) {
  const auto parts = parts_in(directory, running);
  ABBE_TRY(parts);
  std::vector<LeftRecording> closed;
  for (const auto& part : *parts) {
    if (stop) break;
    auto one = close_one(part, stop);
    if (!one) closed.push_back({.file = part, .fault = one.error().text});
    if (one && *one) closed.push_back(std::move(**one));
  }
  return closed;
}

}  // namespace abbe::daemon
