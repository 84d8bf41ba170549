#include "recording_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <limits>
#include <optional>
#include <utility>

namespace abbe::daemon::recording {
namespace {

using tl::unexpected;

std::uint64_t free_bytes_from(const struct statvfs& fs) noexcept {
  return std::uint64_t{fs.f_bavail} * std::uint64_t{fs.f_frsize};
}

/// Makes the directory entry of `file` durable: a created or renamed file survives a power cut only
/// after its directory was written to the disk.
tl::expected<void, IoFault> sync_directory_of(const std::filesystem::path& file) {
  const std::filesystem::path directory = file.has_parent_path() ? file.parent_path() : ".";
  const int fd = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return unexpected(io_fault("open", directory, errno));
  const int error = ::fsync(fd) == 0 ? 0 : errno;
  ::close(fd);
  // EINVAL means that this file system cannot sync a directory; that is not treated as a fault.
  if (error != 0 && error != EINVAL) return unexpected(io_fault("fsync", directory, error));
  return {};
}

int rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to) noexcept {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return errno;
  // This file system has no RENAME_NOREPLACE. A plain rename is safe, because the recorder checked
  // that `to` did not exist when the recording began.
  return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

IoFault io_fault(const char* verb, const std::filesystem::path& file, int error) {
  return {error, fmt::format("{} {}: {}", verb, file.string(), std::strerror(error))};
}

bool is_disk_full(int error) noexcept {
  return error == ENOSPC || error == EDQUOT || error == EFBIG;
}

std::uint64_t free_bytes_of(const std::filesystem::path& directory) noexcept {
  struct statvfs fs {};
  return ::statvfs(directory.c_str(), &fs) == 0 ? free_bytes_from(fs)
                                                : std::numeric_limits<std::uint64_t>::max();
}

tl::expected<RecordingFile, IoFault> RecordingFile::create(const std::filesystem::path& part) {
  const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
  if (fd < 0) return unexpected(io_fault("create", part, errno));
  RecordingFile file{fd, part};
  // The lock shows close_left_recordings() that this file is still being written.
  (void)::flock(fd, LOCK_EX | LOCK_NB);
  if (const auto synced = sync_directory_of(part); !synced) {
    file.discard();
    return unexpected(synced.error());
  }
  return file;
}

RecordingFile::RecordingFile(int fd, std::filesystem::path path)
    : fd_(fd), path_(std::move(path)), hash_(std::make_unique<Sha256>()) {}

RecordingFile::RecordingFile(RecordingFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      damaged_(other.damaged_),
      path_(std::move(other.path_)),
      size_(other.size_),
      hash_(std::move(other.hash_)) {}

RecordingFile& RecordingFile::operator=(RecordingFile&& other) noexcept {
  if (this != &other) {
    close();
    fd_ = std::exchange(other.fd_, -1);
    damaged_ = other.damaged_;
    path_ = std::move(other.path_);
    size_ = other.size_;
    hash_ = std::move(other.hash_);
  }
  return *this;
}

RecordingFile::~RecordingFile() {
  close();
}

void RecordingFile::close() noexcept {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

tl::expected<void, IoFault> RecordingFile::append(std::span<const std::byte> piece) {
  std::size_t done = 0;
  while (done < piece.size()) {
    const auto n =
        ::pwrite(fd_, piece.data() + done, piece.size() - done, static_cast<off_t>(size_ + done));
    if (n > 0) {
      done += static_cast<std::size_t>(n);
    } else if (n == 0 || errno != EINTR) {
      const int error = n == 0 ? ENOSPC : errno;
      // If the file cannot be cut back either, a truncated chunk remains at its end; readers skip
      // it.
      if (::ftruncate(fd_, static_cast<off_t>(size_)) != 0) { /* see above */
      }
      return unexpected(io_fault("write", path_, error));
    }
  }

  size_ += piece.size();
  hash_->update(piece);
  return {};
}

tl::expected<void, IoFault> RecordingFile::sync() {
  if (::fdatasync(fd_) == 0) return {};
  const IoFault fault = io_fault("fdatasync", path_, errno);
  mark_damaged();
  return unexpected(fault);
}

std::filesystem::path RecordingFile::finished_path() const {
  auto finished = path_;
  finished.replace_extension();  // removes .part
  if (damaged_ && finished.stem().extension() != ".damaged")
    finished.replace_extension(".damaged.mcap");
  return finished;
}

void RecordingFile::mark_damaged() {
  damaged_ = true;
  auto part = finished_path();
  part += ".part";
  if (rename_to_new(path_, part) == 0) path_ = std::move(part);
}

tl::expected<void, IoFault> RecordingFile::finish() {
  if (!is_open()) return {};
  // After the last magic no bytes may follow: removes a truncated piece that append() could not
  // remove.
  if (::ftruncate(fd_, static_cast<off_t>(size_)) != 0)
    return unexpected(io_fault("truncate", path_, errno));

  std::optional<IoFault> unproven;
  if (::fsync(fd_) != 0 && !std::exchange(damaged_, true))
    unproven = io_fault("fsync", path_, errno);
  const auto finished = finished_path();

  if (const int error = rename_to_new(path_, finished); error != 0) {
    return unexpected(io_fault("rename", path_, error));
  }

  path_ = finished;
  close();
  if (unproven) return unexpected(*unproven);

  return sync_directory_of(path_);
}

void RecordingFile::discard() noexcept {
  ::unlink(path_.c_str());
  close();
}

std::uint64_t RecordingFile::free_bytes() const noexcept {
  struct statvfs fs {};
  return ::fstatvfs(fd_, &fs) == 0 ? free_bytes_from(fs)
                                   : std::numeric_limits<std::uint64_t>::max();
}

}  // namespace abbe::daemon::recording
