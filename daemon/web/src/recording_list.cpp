#include "abbe/web/recording_list.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <system_error>
#include <vector>

#include "abbe/base/utc_text.hpp"

namespace abbe::web {
namespace {

using daemon::ErrorCode;
using daemon::Result;
namespace fs = std::filesystem;

constexpr std::string_view kFinished = ".mcap", kRunning = ".mcap.part";
constexpr std::size_t kMostListed = 1000;  ///< the newest

bool is_recording(std::string_view name) {
  const auto allowed = [](char c) {
    return static_cast<unsigned char>(c) >= ' ' && c != '/' && c != '"';
  };
  return !name.starts_with('.') && std::ranges::all_of(name, allowed) &&
         (name.ends_with(kFinished) || name.ends_with(kRunning));
}

struct Found {
  std::string name;
  std::uint64_t bytes = 0;
  fs::file_time_type modified;
};

std::string utc_text(fs::file_time_type time) {
  const auto system = std::chrono::file_clock::to_sys(time);
  return daemon::to_text(std::chrono::time_point_cast<std::chrono::nanoseconds>(system));
}

}  // namespace

Result<nlohmann::json> recordings_json(const fs::path& folder) {
  std::error_code error;
  std::vector<Found> files;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    Found found{.name = at->path().filename().string(), .bytes = 0, .modified = {}};
    if (!is_recording(found.name)) continue;
    std::error_code gone, changed;  // retention may remove a file meanwhile
    if (at->symlink_status(gone).type() != fs::file_type::regular) continue;
    found.bytes = at->file_size(gone);
    found.modified = at->last_write_time(changed);
    if (!gone && !changed) files.push_back(std::move(found));
  }
  if (error)
    return daemon::fail(ErrorCode::Io,
                        fmt::format("recordings in {}: {}", folder.string(), error.message()));

  std::ranges::sort(files, std::ranges::greater{}, &Found::modified);
  files.resize(std::min(files.size(), kMostListed));
  nlohmann::json list = nlohmann::json::array();
  for (const Found& f : files)
    list.push_back({{"name", f.name},
                    {"bytes", f.bytes},
                    {"modified", utc_text(f.modified)},
                    {"finished", f.name.ends_with(kFinished)}});
  return list;
}

Result<OpenRecording> open_recording(const fs::path& folder, const std::string& name) {
  if (!is_recording(name))
    return daemon::fail(ErrorCode::Usage, fmt::format("\"{}\" is not a recording", name));
  OpenRecording opened{
      .fd = daemon::FileDescriptor{::open((folder / name).c_str(),
                                          O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)},
      .bytes = 0,
      .etag = {}};
  struct stat seen {};
  if (!opened.fd || ::fstat(opened.fd.get(), &seen) != 0)
    return daemon::fail(ErrorCode::Io, fmt::format("recording {}: {}", name, std::strerror(errno)));
  if (!S_ISREG(seen.st_mode))
    return daemon::fail(ErrorCode::Io, fmt::format("recording {}: not a file", name));
  opened.bytes = static_cast<std::uint64_t>(seen.st_size);
  if (name.ends_with(kFinished))
    opened.etag = fmt::format("\"{:x}-{:x}-{:x}.{:x}\"", seen.st_ino, seen.st_size,
                              seen.st_mtim.tv_sec, seen.st_mtim.tv_nsec);
  return opened;
}

}  // namespace abbe::web
