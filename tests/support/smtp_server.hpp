#pragma once
/// A mail server on a loopback port that keeps what it receives [RFC 5321], written for tests: one
/// connection after the other, no TLS.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace abbe::test {

struct ReceivedMail {
  std::string from, to;  ///< of the envelope, with < and >
  std::string login;     ///< as sent for AUTH PLAIN, with its line end
  std::string data;      ///< as sent, dots of transparency included
};

class SmtpServer {
 public:
  /// `replies`: instead of the usual ones, by the beginning of a command, for example
  /// {"RCPT TO:<bob", "550 no such user"}.
  explicit SmtpServer(std::map<std::string, std::string> replies = {})
      : replies_(std::move(replies)), listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);  // as the socket API requires
    (void)::bind(listener_, generic, size);
    (void)::listen(listener_, 16);
    (void)::getsockname(listener_, generic, &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  SmtpServer(const SmtpServer&) = delete;
  SmtpServer& operator=(const SmtpServer&) = delete;
  ~SmtpServer() {
    stopping_ = true;
    thread_.join();
    ::close(listener_);
  }

  [[nodiscard]] std::string url() const { return "smtp://127.0.0.1:" + std::to_string(port_); }
  [[nodiscard]] bool wait_for(std::size_t mails) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds{30},
                             [&] { return mails_.size() >= mails; });
  }
  [[nodiscard]] std::vector<ReceivedMail> mails() const {
    const std::lock_guard lock(mutex_);
    return mails_;
  }
  [[nodiscard]] std::vector<std::string> commands() const {
    const std::lock_guard lock(mutex_);
    return commands_;
  }

 private:
  static constexpr int kPoll_ms = 50;

  void run() {
    while (!stopping_) {
      pollfd wait{listener_, POLLIN, 0};
      if (::poll(&wait, 1, kPoll_ms) <= 0) continue;
      const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
      if (client < 0) continue;
      serve(client);
      ::close(client);
    }
  }

  /// Up to a line end; empty: the connection ended.
  std::string line_of(int client, std::string& inbox) const {
    while (!stopping_) {
      if (const auto end = inbox.find("\r\n"); end != std::string::npos) {
        std::string line = inbox.substr(0, end + 2);
        inbox.erase(0, end + 2);
        return line;
      }
      pollfd wait{client, POLLIN, 0};
      if (::poll(&wait, 1, kPoll_ms) <= 0) continue;
      std::array<char, 4096> buffer{};
      const ssize_t n = ::read(client, buffer.data(), buffer.size());
      if (n <= 0) return {};
      inbox.append(buffer.data(), static_cast<std::size_t>(n));
    }
    return {};
  }

  static void reply(int client, const std::string& text) {
    const std::string line = text + "\r\n";
    (void)::send(client, line.data(), line.size(), MSG_NOSIGNAL);
  }

  [[nodiscard]] std::string reply_to(const std::string& command) const {
    for (const auto& [beginning, text] : replies_)
      if (command.starts_with(beginning)) return text;
    if (command.starts_with("EHLO")) return "250-test.example\r\n250 AUTH PLAIN";
    if (command == "AUTH PLAIN") return "334 ";  // the credentials follow on a line of their own
    if (command.starts_with("AUTH")) return "235 welcome";
    if (command.starts_with("DATA")) return "354 end with a dot";
    return command.starts_with("QUIT") ? "221 bye" : "250 ok";
  }

  void serve(int client) {
    std::string inbox;
    ReceivedMail mail;
    reply(client, "220 test.example ESMTP");
    for (std::string line; !(line = line_of(client, inbox)).empty();) {
      const std::string command = line.substr(0, line.size() - 2);
      note(command);
      const std::string text = reply_to(command);
      reply(client, text);
      if (text.starts_with("334")) {
        mail.login = line_of(client, inbox);
        reply(client, "235 welcome");
      }
      if (command.starts_with("MAIL FROM:")) mail.from = command.substr(10);
      if (command.starts_with("RCPT TO:")) mail.to = command.substr(8);
      if (command.starts_with("QUIT")) return;
      if (!text.starts_with("354")) continue;

      for (std::string data; !(data = line_of(client, inbox)).empty() && data != ".\r\n";)
        mail.data += data;
      const std::string taken = reply_to("content");
      reply(client, taken);
      if (taken.starts_with("250")) keep(mail);
    }
  }

  void note(const std::string& command) {
    const std::lock_guard lock(mutex_);
    commands_.push_back(command);
  }
  void keep(const ReceivedMail& mail) {
    const std::lock_guard lock(mutex_);
    mails_.push_back(mail);
    changed_.notify_all();
  }

  std::map<std::string, std::string> replies_;
  int listener_;
  int port_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<ReceivedMail> mails_;
  std::vector<std::string> commands_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace abbe::test
