#include "abbe/drivers/serial_line.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace abbe::drivers {
namespace {

auto no_lock(const char* what, int error) {
  return tl::unexpected(Error{ErrorCode::Unreachable,
                              fmt::format("{}: {}", what, std::system_category().message(error))});
}

}  // namespace

SerialLock& SerialLock::operator=(SerialLock&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

SerialLock::~SerialLock() {
  if (fd_ >= 0) ::close(fd_);
}

Result<void> SerialLock::take(const std::string& path) {
  fd_ = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd_ < 0) return no_lock("open", errno);
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0) return {};
  if (errno != EWOULDBLOCK) return no_lock("lock", errno);
  return tl::unexpected(
      Error{ErrorCode::Unreachable,
            "open: this serial line is in use by another program, or by an [[environment]] that "
            "names it by another path: give all devices of one line the same path"});
}

}  // namespace abbe::drivers
