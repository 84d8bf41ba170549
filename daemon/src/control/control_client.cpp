#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "abbe/daemon/control_protocol.hpp"
#include "control/json_line.hpp"
#include "control/refusal.hpp"
#include "control/unix_socket.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

Error no_answer(const std::filesystem::path& path, std::string seen) {
  return {ErrorCode::Io, fmt::format("daemon at {}: {}", path.string(), seen)};
}

Result<void> send_line(int fd, const std::string& line, const std::filesystem::path& path) {
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t n = ::send(fd, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return tl::unexpected(no_answer(path, std::strerror(errno)));
    sent += static_cast<std::size_t>(n);
  }
  return {};
}

Result<std::string> receive_line(int fd, std::chrono::milliseconds time_out,
                                 const std::filesystem::path& path) {
  std::string line;
  std::array<char, 65536> buffer;  // NOLINT: read() fills what is used
  while (line.find('\n') == std::string::npos) {
    pollfd wait{fd, POLLIN, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(time_out.count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0)
      return tl::unexpected(no_answer(path, fmt::format("no answer in {} ms", time_out.count())));
    const ssize_t n = ::read(fd, buffer.data(), buffer.size());
    if (n <= 0) return tl::unexpected(no_answer(path, "closed the connection without an answer"));
    line.append(buffer.data(), static_cast<std::size_t>(n));
  }
  return line.substr(0, line.find('\n'));
}

}  // namespace

Result<json> ask_daemon(const std::filesystem::path& socket_path, const json& request,
                        std::chrono::milliseconds time_out) {
  auto fd = connect_unix(socket_path);
  if (!fd) return tl::unexpected(Error{fd.error().code, fd.error().text + " (is abbed running?)"});
  if (auto sent = send_line(fd->get(), line_of(request), socket_path); !sent)
    return tl::unexpected(sent.error());
  const auto line = receive_line(fd->get(), time_out, socket_path);
  if (!line) return tl::unexpected(line.error());
  json answer = json::parse(*line, nullptr, /*allow_exceptions=*/false);
  if (!answer.is_object())
    return tl::unexpected(no_answer(socket_path, "answered something that is not a JSON object"));
  const auto ok = answer.find("ok");
  if (ok == answer.end() || *ok != true) return tl::unexpected(error_of_refusal(answer));
  return answer;
}

}  // namespace abbe::daemon
