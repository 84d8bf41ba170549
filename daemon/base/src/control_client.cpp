#include <fmt/format.h>
#include <grp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/control_connection.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/refusal.hpp"
#include "abbe/base/unix_socket.hpp"
#include "abbe/protocol/printable.hpp"
#include "json_line.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kLongestAnswer = 64u << 20;  // a verification with 10^5 standstills: 20 MB

Error no_answer(const std::filesystem::path& path, std::string seen) {
  return {ErrorCode::Io, fmt::format("daemon at {}: {}", path.string(), seen)};
}

/// The name in /etc/group, else the number. Never asks a name service, which could hang.
std::string group_name(gid_t gid) {
  const std::unique_ptr<FILE, int (*)(FILE*)> file(std::fopen("/etc/group", "re"), &std::fclose);
  std::array<char, 16384> buffer;
  group entry{};
  group* found = nullptr;
  while (file && ::fgetgrent_r(file.get(), &entry, buffer.data(), buffer.size(), &found) == 0)
    if (found->gr_gid == gid) return found->gr_name;
  return fmt::format("{}", gid);
}

/// True if this process is a member of the group.
bool in_group(gid_t gid) {
  std::array<gid_t, 1024> groups{};
  const int count = ::getgroups(static_cast<int>(groups.size()), groups.data());
  return ::getegid() == gid || std::find(groups.begin(), groups.begin() + std::max(count, 0),
                                         gid) != groups.begin() + std::max(count, 0);
}

/// Advice for the user if the socket cannot be connected.
std::string advice(const std::filesystem::path& socket) {
  struct stat seen {};
  if (::access(socket.c_str(), R_OK | W_OK) == 0 || errno != EACCES ||
      (::stat(socket.c_str(), &seen) != 0 && ::stat(socket.parent_path().c_str(), &seen) != 0))
    return "is abbed running?";
  if (seen.st_gid == 0 || (seen.st_mode & S_IRWXG) == 0 || in_group(seen.st_gid))
    return "this user may not open it; use sudo, or the user that runs abbed";
  return fmt::format(
      "this user is not in the group {0}: run `sudo usermod -aG {0} $USER` and log in again, or "
      "use sudo",
      group_name(seen.st_gid));
}

Result<void> send_line(int fd, const std::string& line, const std::filesystem::path& path) {
  for (std::size_t sent = 0; sent < line.size();) {
    const ssize_t n = ::send(fd, line.data() + sent, line.size() - sent, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN)
      return tl::unexpected(no_answer(path, "does not accept the request"));
    if (n <= 0) return tl::unexpected(no_answer(path, std::strerror(errno)));
    sent += static_cast<std::size_t>(n);
  }
  return {};
}

/// Time from now until `end`, at least 0.
int remaining_ms(Clock::time_point end) {
  return static_cast<int>(std::max<std::int64_t>(
      0, std::chrono::ceil<std::chrono::milliseconds>(end - Clock::now()).count()));
}

Result<std::string> receive_line(int fd, std::chrono::milliseconds time_out,
                                 const std::filesystem::path& path) {
  const auto end = Clock::now() + time_out;
  std::string line;
  std::array<char, 65536> buffer;  // NOLINT: read() fills what is used

  for (;;) {
    pollfd wait{fd, POLLIN, 0};
    const int ready = ::poll(&wait, 1, remaining_ms(end));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0)
      return tl::unexpected(no_answer(path, fmt::format("no answer in {} ms", time_out.count())));
    const ssize_t n = ::read(fd, buffer.data(), buffer.size());
    if (n <= 0) return tl::unexpected(no_answer(path, "closed the connection without an answer"));
    const std::string_view received{buffer.data(), static_cast<std::size_t>(n)};
    line += received.substr(0, received.find('\n'));
    if (received.find('\n') != std::string_view::npos) return line;
    if (line.size() > kLongestAnswer)
      return tl::unexpected(no_answer(path, "the answer is too long"));
  }
}

/// `text` without the control characters that a terminal executes. Tabs and line ends remain: the
/// text of a configuration file is an answer, too.
std::string harmless(std::string_view text) {
  const auto is_kept = [](char c) { return c == '\t' || c == '\r'; };
  std::string out;
  while (!text.empty()) {
    const auto end = std::ranges::find_if(text, is_kept);
    const auto length = static_cast<std::size_t>(end - text.begin());
    out += protocol::without_control_characters(text.substr(0, length));
    if (end != text.end()) out += *end;
    text.remove_prefix(std::min(text.size(), length + 1));
  }
  return out;
}

/// Replaces control characters that a device may have sent to the daemon and that a terminal would
/// execute. The depth of `value` is bounded by parse_json().
void replace_control_characters(json& value) {
  if (value.is_string()) value = harmless(value.get_ref<const std::string&>());
  if (value.is_structured())
    for (json& element : value) replace_control_characters(element);
}

}  // namespace

Result<json> ask_daemon(const std::filesystem::path& socket_path, const json& request,
                        std::chrono::milliseconds time_out) {
  return ControlConnection{socket_path}.ask(request, time_out);
}

Result<json> ControlConnection::ask(const json& request, std::chrono::milliseconds time_out) {
  auto answer = exchange(request, time_out);
  if (!answer) {  // a late answer to this request would be taken for the answer to the next one
    fd_ = FileDescriptor{};
    return answer;
  }

  const auto ok = answer->find("ok");
  if (ok == answer->end() || *ok != true) return tl::unexpected(error_of_refusal(*answer));
  return answer;
}

Result<json> ControlConnection::exchange(const json& request, std::chrono::milliseconds time_out) {
  if (!fd_) {
    auto fd = connect_unix(path_, time_out);
    if (!fd)
      return tl::unexpected(
          Error{fd.error().code, fmt::format("{} ({})", fd.error().text, advice(path_))});
    fd_ = std::move(*fd);
    set_send_time_out(fd_.get(), time_out);
  }

  const auto sent = send_line(fd_.get(), line_of(request), path_);
  // If the daemon closed the connection before the end of the request, it has sent the reason
  // first.
  const auto line = receive_line(fd_.get(), sent ? time_out : 0ms, path_);
  if (!line) return tl::unexpected(sent ? line.error() : sent.error());

  auto parsed = parse_json(*line, "answer", {.bytes = kLongestAnswer, .values = kLongestAnswer});
  if (!parsed) return tl::unexpected(no_answer(path_, parsed.error().text));
  if (!parsed->is_object())
    return tl::unexpected(no_answer(path_, "the answer is not a JSON object"));
  replace_control_characters(*parsed);
  return std::move(*parsed);
}

}  // namespace abbe::daemon
