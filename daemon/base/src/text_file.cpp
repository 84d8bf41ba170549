#include "abbe/base/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {

namespace {

tl::unexpected<Error> io_failure(std::string_view verb, const std::filesystem::path& file) {
  return fail(ErrorCode::Io, fmt::format("{} {}: {}", verb, file.string(), std::strerror(errno)));
}

bool write_all(int fd, std::string_view text) {
  while (!text.empty()) {
    const auto written = ::write(fd, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// Syncs the folder to the disk. Only after this, a file that was renamed in the folder keeps its
/// new name in a power failure.
bool sync_folder(const std::filesystem::path& folder) {
  const FileDescriptor fd(
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return fd.get() >= 0 && ::fsync(fd.get()) == 0;
}

Result<std::string> read_all(const FileDescriptor& fd, const struct stat& status,
                             const std::filesystem::path& file) {
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t have = 0;
  for (;;) {
    // The file has an unknown size (pipe), or became longer after fstat().
    if (have == text.size()) text.resize(text.size() + 65536);
    const auto got = ::read(fd.get(), text.data() + have, text.size() - have);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return io_failure("read", file);
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }

  text.resize(have);
  return text;
}

}  // namespace

Result<std::string> read_text(const std::filesystem::path& file) {
  const FileDescriptor fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0) return io_failure("read", file);
  return read_all(fd, status, file);
}

Result<std::string> read_regular_file(const std::filesystem::path& file) {
  constexpr off_t kMost_bytes = off_t{1} << 30;
  const FileDescriptor fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat status {};
  // ENXIO means a socket, or a device file without a device.
  if (!fd && errno != ENXIO) return io_failure("read", file);
  if (!fd || ::fstat(fd.get(), &status) != 0 || !S_ISREG(status.st_mode))
    return fail(ErrorCode::BadInput, fmt::format("read {}: is not a regular file", file.string()));
  if (status.st_size > kMost_bytes)
    return fail(ErrorCode::BadInput, fmt::format("read {}: larger than 1 GiB", file.string()));
  return read_all(fd, status, file);
}

namespace {

struct Ownership {
  uid_t owner;
  gid_t group;
  mode_t mode;
};

void set_ownership(int fd, const Ownership& to) noexcept {
  struct stat status {};
  if (::fstat(fd, &status) != 0) return;
  if (status.st_uid != to.owner && ::fchown(fd, to.owner, to.group) == 0) status.st_gid = to.group;
  // Without root rights the call above fails, but a process may give its file to a group that the
  // process is a member of.
  if (status.st_gid != to.group) (void)!::fchown(fd, static_cast<uid_t>(-1), to.group);
  (void)::fchmod(fd, to.mode);
}

std::optional<Ownership> ownership_in_folder(const std::filesystem::path& folder) noexcept {
  constexpr mode_t kFileModes = 0664;
  struct stat status {};
  if (::stat(folder.empty() ? "." : folder.c_str(), &status) != 0) return std::nullopt;
  return Ownership{status.st_uid, status.st_gid, status.st_mode & kFileModes};
}

/// Owner and mode of `file` if it is a regular file, else those of a new file in its folder.
std::optional<Ownership> ownership_of(const std::filesystem::path& file) noexcept {
  struct stat status {};
  if (::lstat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode))
    return ownership_in_folder(file.parent_path());
  return Ownership{status.st_uid, status.st_gid, status.st_mode & 0777U};
}

/// Creates `file` and never follows a link: when root writes into a folder of another user, that
/// user could have placed a link there.
FileDescriptor create_fresh(const std::filesystem::path& file) {
  constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  ::unlink(file.c_str());  // left by a killed process with the same PID
  return FileDescriptor{::open(file.c_str(), kFlags, 0600)};
}

}  // namespace

void inherit_ownership(int fd, const std::filesystem::path& folder) noexcept {
  if (const auto ownership = ownership_in_folder(folder)) set_ownership(fd, *ownership);
}

namespace {

Result<void> create_missing(const std::filesystem::path& folder, NewFolder kind) {
  std::error_code error;
  if (folder.empty() || std::filesystem::is_directory(folder, error)) return {};
  ABBE_TRY(create_missing(folder.parent_path(), kind));
  if (::mkdir(folder.c_str(), 0777) != 0)
    return errno == EEXIST ? Result<void>{} : io_failure("create", folder);
  if (kind == NewFolder::OfTheCaller) return {};

  struct stat above {};
  const auto parent = folder.parent_path();
  const FileDescriptor fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));

  // A folder that root creates in the folder of another user must be usable by that user.
  if (fd && ::geteuid() == 0 && ::stat(parent.empty() ? "." : parent.c_str(), &above) == 0 &&
      above.st_uid != 0)
    set_ownership(fd.get(), {above.st_uid, above.st_gid, above.st_mode & 0777U});

  return {};
}

}  // namespace

Result<void> create_folder(const std::filesystem::path& folder, NewFolder kind) {
  ABBE_TRY(create_missing(folder, kind));
  std::error_code error;
  if (folder.empty() || std::filesystem::is_directory(folder, error)) return {};
  errno = ENOTDIR;
  return io_failure("create", folder);
}

Result<void> replace_file(const std::filesystem::path& file, std::string_view text) {
  const std::filesystem::path fresh = fmt::format("{}.{}.new", file.string(), ::getpid());
  {
    const FileDescriptor fd = create_fresh(fresh);
    if (fd.get() < 0) return io_failure("write", fresh);
    if (const auto ownership = ownership_of(file)) set_ownership(fd.get(), *ownership);
    if (!write_all(fd.get(), text) || ::fsync(fd.get()) != 0) {
      const auto failure = io_failure("write", fresh);
      ::unlink(fresh.c_str());
      return failure;
    }
  }

  if (::rename(fresh.c_str(), file.c_str()) != 0) {
    const auto failure = io_failure("replace", file);
    ::unlink(fresh.c_str());
    return failure;
  }

  if (!sync_folder(file.parent_path())) return io_failure("sync the folder of", file);
  return {};
}

void remove_half_written(const std::filesystem::path& file) {
  std::error_code failed;
  const std::string prefix = file.filename().string() + ".";
  for (std::filesystem::directory_iterator entry{file.parent_path(), failed}, end;
       !failed && entry != end; entry.increment(failed)) {
    const auto name = entry->path().filename().string();
    std::error_code ignored;
    if (name.starts_with(prefix) && name.ends_with(".new"))
      std::filesystem::remove(entry->path(), ignored);
  }
}

}  // namespace abbe::daemon
