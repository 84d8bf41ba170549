#include "store_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include "abbe/base/text_file.hpp"

namespace abbe::daemon {

namespace {

namespace fs = std::filesystem;

constexpr auto kLockPollPeriod = std::chrono::milliseconds{10};
constexpr int kLockFlags = O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;

/// Sets the mode of the lock file to 0660 if the group may write to the folder, else to 0600, also
/// if the file existed with another mode.
void restrict_access(int lock, const fs::path& folder) noexcept {
  struct stat file {
  }, of_folder{};
  if (::fstat(lock, &file) != 0 || ::stat(folder.c_str(), &of_folder) != 0) return;
  const mode_t mode = (of_folder.st_mode & S_IWGRP) != 0 ? 0660 : 0600;
  if ((file.st_mode & 0777U) != mode) (void)::fchmod(lock, mode);
}

FileDescriptor open_lock(const fs::path& file) {
  const auto folder = file.parent_path();
  FileDescriptor lock{::open(file.c_str(), kLockFlags)};
  if (!lock && errno == ENOENT) {
    lock = FileDescriptor{::open(file.c_str(), kLockFlags | O_CREAT | O_EXCL, 0600)};
    // If root creates the lock file, it gets the owner of the folder, so that the daemon can lock
    // it, too.
    if (lock) inherit_ownership(lock.get(), folder);
    // EEXIST: another process created the lock file in the meantime.
    else if (errno == EEXIST)
      lock = FileDescriptor{::open(file.c_str(), kLockFlags)};
  }
  if (lock) restrict_access(lock.get(), folder);
  return lock;
}

/// Name of a file in /proc/locks: "fe:01:4711".
std::string name_in_proc(const struct stat& file) {
  return fmt::format("{:02x}:{:02x}:{}", major(file.st_dev), minor(file.st_dev), file.st_ino);
}

/// The process that holds the lock, as text " (process 4711)"; empty if /proc/locks is not readable
/// or does not list this file system.
std::string holder_of(int lock) {
  struct stat file {};
  if (::fstat(lock, &file) != 0) return {};
  const std::string wanted = name_in_proc(file);
  std::ifstream locks{"/proc/locks"};
  for (std::string line; std::getline(locks, line);) {
    std::istringstream fields{line};
    std::string number, kind, advisory, access, process, where;
    fields >> number >> kind >> advisory >> access >> process >> where;
    if (kind == "FLOCK" && where == wanted) return fmt::format(" (process {})", process);
  }
  return {};
}

}  // namespace

Result<FileDescriptor> lock_store(const fs::path& folder, std::chrono::nanoseconds time_out) {
  const auto failure = [&folder](std::string_view seen) {
    return fail(ErrorCode::Io, fmt::format("lock the model store {}: {}", folder.string(), seen));
  };

  FileDescriptor lock = open_lock(folder / "lock");
  if (!lock) return failure(std::strerror(errno));
  const auto until = std::chrono::steady_clock::now() + time_out;

  while (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK && errno != EINTR) return failure(std::strerror(errno));
    if (std::chrono::steady_clock::now() > until)
      return failure(fmt::format("another process{} has held it for {:.0f} s",
                                 holder_of(lock.get()),
                                 std::chrono::duration<double>(time_out).count()));
    std::this_thread::sleep_for(kLockPollPeriod);
  }

  return lock;
}

}  // namespace abbe::daemon
