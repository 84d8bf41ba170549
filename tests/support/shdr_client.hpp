#pragma once
/// The agent's side of SHDR, written from the documentation "SHDR 2.0" of cppagent, without code of
/// abbe: a parser of lines, and a TCP client that keeps what an agent would show.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

namespace abbe::test {

/// The fields of a line: separated by "|"; in a field enclosed in quotation marks a backslash takes
/// the next character as it is.
inline std::vector<std::string> shdr_fields(std::string_view line) {
  std::vector<std::string> fields(1);
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (fields.back().empty() && line[i] == '"' && (i == 0 || line[i - 1] == '|')) {
      for (++i; i < line.size() && line[i] != '"'; ++i) {
        if (line[i] == '\\') ++i;
        if (i < line.size()) fields.back() += line[i];
      }
    } else if (line[i] == '|') {
      fields.emplace_back();
    } else {
      fields.back() += line[i];
    }
  }
  return fields;
}

/// What an agent shows of a data item after the lines that it has received.
class ShdrView {
 public:
  struct Raised {
    std::string level, text;
  };

  void take(const std::string& line) {
    if (line.starts_with("*")) {
      commands.push_back(line);
      return;
    }
    static const std::regex time(R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z)");
    const auto fields = shdr_fields(line);
    EXPECT_TRUE(std::regex_match(fields[0], time)) << line;
    ASSERT_GE(fields.size(), 3u) << line;
    ++lines_of[fields[1]];
    if (fields.size() == 3) {
      events[fields[1]] = fields[2];
    } else if (fields.size() == 4) {
      events[fields[1]] = fields[3];
      codes[fields[1]] = fields[2];
    } else {
      ASSERT_EQ(fields.size(), 7u) << line;
      take_condition(conditions[fields[1]], fields);
    }
  }

  /// "NORMAL", "UNAVAILABLE", or the worst level.
  [[nodiscard]] std::string level(const std::string& condition) const {
    const auto found = conditions.find(condition);
    if (found == conditions.end()) return "not received";
    std::string worst = found->second.empty() ? "NORMAL" : "WARNING";
    for (const auto& [code, raised] : found->second)
      if (raised.level != "WARNING") worst = raised.level;
    return worst;
  }

  std::map<std::string, std::string> events, codes;
  std::map<std::string, std::map<std::string, Raised>> conditions;  ///< by native code
  std::map<std::string, int> lines_of;                              ///< received, by data item
  std::vector<std::string> commands;

 private:
  using Condition = std::map<std::string, Raised>;

  /// NORMAL without a native code ends all; UNAVAILABLE replaces all.
  static void take_condition(Condition& condition, const std::vector<std::string>& fields) {
    const std::string &level = fields[2], &code = fields[3];
    if (level == "UNAVAILABLE" || (level == "NORMAL" && code.empty())) condition.clear();
    if (level == "UNAVAILABLE") condition[""] = {level, ""};
    if (level == "NORMAL") {
      condition.erase(code);
    } else if (level != "UNAVAILABLE") {
      condition.erase("");
      condition[code] = {level, fields[6]};
    }
  }
};

class ShdrClient {
 public:
  explicit ShdrClient(std::uint16_t port, int receive_buffer_bytes = 0)
      : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (receive_buffer_bytes > 0)
      ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(port);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(fd_, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0;
  }
  ShdrClient(const ShdrClient&) = delete;
  ShdrClient& operator=(const ShdrClient&) = delete;
  ~ShdrClient() { ::close(fd_); }

  [[nodiscard]] bool connected() const { return connected_; }
  /// As the server names it.
  [[nodiscard]] std::string name() const {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&own), &size);
    return "127.0.0.1:" + std::to_string(ntohs(own.sin_port));
  }
  /// False: the server has closed the connection.
  bool send(std::string_view text) {
    return ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT) ==
           static_cast<ssize_t>(text.size());
  }
  /// Reads what has arrived, or arrives within `at_most`, into view(). False: the connection is
  /// closed.
  bool read(std::chrono::milliseconds at_most = std::chrono::milliseconds{0}) {
    pollfd wait{fd_, POLLIN, 0};
    while (::poll(&wait, 1, static_cast<int>(at_most.count())) > 0) {
      std::array<char, 65536> buffer;  // NOLINT: recv() fills what is used
      const ssize_t n = ::recv(fd_, buffer.data(), buffer.size(), 0);
      if (n <= 0) return false;
      inbox_.append(buffer.data(), static_cast<std::size_t>(n));
      for (std::size_t end; (end = inbox_.find('\n')) != std::string::npos;) {
        view_.take(inbox_.substr(0, end));
        inbox_.erase(0, end + 1);
      }
      at_most = std::chrono::milliseconds{0};
    }
    return true;
  }
  [[nodiscard]] const ShdrView& view() const { return view_; }

 private:
  int fd_;
  bool connected_ = false;
  std::string inbox_;
  ShdrView view_;
};

}  // namespace abbe::test
