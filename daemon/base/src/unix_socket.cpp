#include "abbe/base/unix_socket.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>

#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

constexpr int kBacklog = 16;
constexpr mode_t kOwnerAndGroup = 0660;

Result<sockaddr_un> address_of(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.native().size() >= sizeof address.sun_path) {
    return tl::unexpected(
        Error{ErrorCode::Usage, fmt::format("socket {}: the path is longer than {} characters",
                                            path.string(), sizeof address.sun_path - 1)});
  }
  std::memcpy(address.sun_path, path.c_str(), path.native().size() + 1);
  return address;
}

Error failed(const char* what, const std::filesystem::path& path) {
  return {ErrorCode::Io, fmt::format("{} {}: {}", what, path.string(), std::strerror(errno))};
}

}  // namespace

void set_send_time_out(int fd, std::chrono::milliseconds time_out) noexcept {
  const auto ms = time_out.count();
  const timeval most{.tv_sec = ms / 1000, .tv_usec = ms % 1000 * 1000};
  (void)::setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &most, sizeof most);
}

Result<FileDescriptor> connect_unix(const std::filesystem::path& path,
                                    std::chrono::milliseconds time_out) {
  auto address = address_of(path);
  ABBE_TRY(address);
  FileDescriptor fd{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  if (!fd) return tl::unexpected(failed("connect", path));

  // SO_SNDTIMEO also limits how long connect() waits for a place in the listener's backlog
  // [unix(7)].
  set_send_time_out(fd.get(), time_out);
  // the socket API requires this cast
  const auto* generic = reinterpret_cast<const sockaddr*>(&*address);

  if (::connect(fd.get(), generic, sizeof *address) != 0) {
    if (errno != EAGAIN) return tl::unexpected(failed("connect", path));
    return fail(ErrorCode::Io,
                fmt::format("connect {}: the listening process accepted no connection in {} ms",
                            path.string(), time_out.count()));
  }

  set_send_time_out(fd.get(), std::chrono::milliseconds{0});
  return fd;
}

Result<FileDescriptor> connect_unix_datagrams(const std::filesystem::path& path) {
  const auto address = address_of(path);
  ABBE_TRY(address);
  FileDescriptor fd{::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  const auto* generic = reinterpret_cast<const sockaddr*>(&*address);
  if (!fd || ::connect(fd.get(), generic, sizeof *address) != 0)
    return tl::unexpected(failed("connect", path));
  return fd;
}

bool is_listened_at(const std::filesystem::path& path) {
  const auto address = address_of(path);
  if (!address) return false;
  const FileDescriptor fd{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  const auto* generic = reinterpret_cast<const sockaddr*>(&*address);
  return fd && (::connect(fd.get(), generic, sizeof *address) == 0 || errno == EAGAIN);
}

Result<FileDescriptor> listen_unix(const std::filesystem::path& path) {
  auto address = address_of(path);
  ABBE_TRY(address);
  if (is_listened_at(path)) {
    return tl::unexpected(
        Error{ErrorCode::Io,
              fmt::format("listen {}: another daemon already answers there", path.string())});
  }

  std::error_code error;
  const auto type = std::filesystem::symlink_status(path, error).type();
  if (type == std::filesystem::file_type::socket) {
    std::filesystem::remove(path, error);
  } else if (type != std::filesystem::file_type::not_found) {
    return fail(ErrorCode::Io,
                fmt::format("listen {}: the path exists and is not a socket", path.string()));
  }

  FileDescriptor fd{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
  const auto* generic = reinterpret_cast<const sockaddr*>(&*address);
  if (!fd || ::bind(fd.get(), generic, sizeof *address) != 0)
    return tl::unexpected(failed("bind", path));

  if (::chmod(path.c_str(), kOwnerAndGroup) != 0 || ::listen(fd.get(), kBacklog) != 0) {
    return tl::unexpected(failed("listen", path));
  }

  return fd;
}

}  // namespace abbe::daemon
