/// Repairs a store after killed processes and disk errors.

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>

#include "abbe/base/text_file.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/result/try.hpp"
#include "store_lock.hpp"
#include "store_state.hpp"

namespace abbe::daemon {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kDamaged = "state.json.damaged-";
constexpr std::string_view kTemporary = ".new";

/// The PID in a name NAME.PID.new; nullopt for other names.
std::optional<pid_t> writer_of(std::string name) {
  if (!name.ends_with(kTemporary)) return std::nullopt;
  name.resize(name.size() - kTemporary.size());
  const auto dot = name.rfind('.');
  pid_t process = 0;
  if (dot == std::string::npos) return std::nullopt;
  const char* const end = name.data() + name.size();
  const auto read = std::from_chars(name.data() + dot + 1, end, process);
  return read.ec == std::errc{} && read.ptr == end && process > 0 ? std::optional{process}
                                                                  : std::nullopt;
}

/// True if `process`, which wrote a temporary file, does not exist any more. True also for the PID
/// of this process: the file was then written by an earlier process with the same PID.
bool is_gone(pid_t process) noexcept {
  return process == ::getpid() || (::kill(process, 0) != 0 && errno == ESRCH);
}

/// The date for a file name: "2024-05-17T08-30-00Z". It has no colons, which some file systems do
/// not allow.
std::string date_for_name(protocol::UtcTime now) {
  constexpr std::size_t kSeconds = 19;
  std::string date = to_text(now).substr(0, kSeconds) + "Z";
  std::replace(date.begin(), date.end(), ':', '-');
  return date;
}

bool is_damaged(const fs::path& state) {
  std::error_code unknown;
  if (fs::symlink_status(state, unknown).type() == fs::file_type::not_found) return false;
  const auto text = read_regular_file(state);
  if (!text) return text.error().code == ErrorCode::BadInput;
  return !store_state_from_text(*text, state.string());
}

}  // namespace

void ModelStore::remove_leftovers() const {
  for (const auto& folder : {folder_, folder_ / "models"}) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const auto writer = writer_of(entry->path().filename().string());
      std::error_code ignored;
      if (writer && is_gone(*writer) && entry->is_regular_file(ignored))
        fs::remove(entry->path(), ignored);
    }
  }
}

Result<void> ModelStore::rename_damaged_state(protocol::UtcTime now) {
  if (!is_damaged(state_file_)) return {};
  const auto lock = lock_store(folder_, lock_patience_);
  ABBE_TRY(lock);
  if (!is_damaged(state_file_)) return {};  // another process has repaired it
  const auto renamed = folder_ / (std::string{kDamaged} + date_for_name(now));
  if (::renameat2(AT_FDCWD, state_file_.c_str(), AT_FDCWD, renamed.c_str(), RENAME_NOREPLACE) == 0)
    return {};
  return fail(ErrorCode::Io, fmt::format("rename {} to {}: {}", state_file_.string(),
                                         renamed.string(), std::strerror(errno)));
}

std::string ModelStore::damaged_state() const {
  std::string newest;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error)) {
    auto name = entry->path().filename().string();
    if (name.starts_with(kDamaged)) newest = std::max(newest, std::move(name));
  }
  return newest;
}

}  // namespace abbe::daemon
