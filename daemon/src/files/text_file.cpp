#include "files/text_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "files/file_descriptor.hpp"

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

/// The name in the folder is on the disk only after the folder itself is.
bool sync_folder(const std::filesystem::path& folder) {
  const FileDescriptor fd(::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return fd.get() >= 0 && ::fsync(fd.get()) == 0;
}

}  // namespace

Result<std::string> read_text(const std::filesystem::path& file) {
  const FileDescriptor fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (fd.get() < 0 || ::fstat(fd.get(), &status) != 0) return io_failure("read", file);
  std::string text(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t have = 0;
  for (;;) {
    if (have == text.size()) text.resize(text.size() + 65536);  // a pipe, or a file that still grows
    const auto got = ::read(fd.get(), text.data() + have, text.size() - have);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return io_failure("read", file);
    if (got == 0) break;
    have += static_cast<std::size_t>(got);
  }
  text.resize(have);
  return text;
}

Result<void> replace_file(const std::filesystem::path& file, std::string_view text) {
  const std::filesystem::path fresh = fmt::format("{}.{}.new", file.string(), ::getpid());
  {
    const FileDescriptor fd(::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (fd.get() < 0) return io_failure("write", fresh);
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

}  // namespace abbe::daemon
