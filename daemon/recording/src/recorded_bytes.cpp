#include "recorded_bytes.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace abbe::daemon::recording {
namespace {

/// Size of one read. It is large, so that the time for system calls is negligible.
constexpr std::uint64_t kWindow = std::uint64_t{1} << 20;

tl::unexpected<Error> io_error(const char* verb, const std::filesystem::path& file, int error) {
  return fail(ErrorCode::Io, fmt::format("{} {}: {}", verb, file.string(), std::strerror(error)));
}

}  // namespace

RecordedBytes::RecordedBytes(FileDescriptor fd, std::filesystem::path file, std::uint64_t size)
    : fd_(std::move(fd)), file_(std::move(file)), size_(size) {}

Result<std::unique_ptr<RecordedBytes>> RecordedBytes::open(const std::filesystem::path& file) {
  // O_NONBLOCK: opening a pipe does not block
  FileDescriptor fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat status {};
  if (!fd || ::fstat(fd.get(), &status) != 0) return io_error("open", file, errno);
  if (!S_ISREG(status.st_mode))
    return io_error("read", file, S_ISDIR(status.st_mode) ? EISDIR : EINVAL);
  (void)::posix_fadvise(fd.get(), 0, 0, POSIX_FADV_SEQUENTIAL);
  return std::unique_ptr<RecordedBytes>(
      new RecordedBytes(std::move(fd), file, static_cast<std::uint64_t>(status.st_size)));
}

bool RecordedBytes::read(std::uint64_t offset, std::span<std::byte> out) const {
  while (!out.empty()) {
    const auto got = ::pread(fd_.get(), out.data(), out.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return fail_with(std::strerror(errno)), false;
    if (got == 0) return fail_with("the file became shorter while it was read"), false;
    offset += static_cast<std::uint64_t>(got);
    out = out.subspan(static_cast<std::size_t>(got));
  }
  return true;
}

void RecordedBytes::mark_changed() const {
  fail_with("the file changed while it was read");
}

void RecordedBytes::fail_with(const char* what) const {
  const std::lock_guard lock(mutex_);
  if (!failure_) failure_ = Error{ErrorCode::Io, fmt::format("read {}: {}", file_.string(), what)};
}

Result<void> RecordedBytes::intact() const {
  const std::lock_guard lock(mutex_);
  if (failure_) return tl::unexpected(*failure_);
  return {};
}

std::optional<protocol::mcap::Bytes> ByteWindow::at(std::uint64_t offset, std::uint64_t length) {
  if (offset >= file_.size()) return protocol::mcap::Bytes{};
  length = std::min(length, file_.size() - offset);
  if (offset < begin_ || offset + length > begin_ + size_) {
    const std::uint64_t wanted = std::min(std::max(length, kWindow), file_.size() - offset);
    if (buffer_.size() < wanted) buffer_.resize(wanted);
    begin_ = offset;
    size_ = 0;
    if (!file_.read(offset, std::span(buffer_).first(wanted))) return std::nullopt;
    size_ = wanted;
  }
  return std::span(buffer_).subspan(offset - begin_, length);
}

}  // namespace abbe::daemon::recording
