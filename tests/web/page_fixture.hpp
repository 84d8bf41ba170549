#pragma once
/// The page over HTTP, and raw connections to it.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/web/page_server.hpp"
#include "web_folder.hpp"

namespace abbe::web::test {

using nlohmann::json;

struct PageFixture : WebFolder {
  void start(const std::string& web = "", std::chrono::milliseconds write_time_out = kWriteTimeOut,
             std::chrono::milliseconds request_time = kRequestTime) {
    write_users();
    ASSERT_TRUE(daemon::ModelStore::open(folder_ / "data/models"));
    write_config("port = 0\nusers = \"users\"\n" + web);
    auto read = settings();
    ASSERT_TRUE(read) << read.error().text;
    auto page = PageServer::start({.settings = std::move(*read),
                                   .config_file = folder_ / "abbed.toml",
                                   .write_time_out = write_time_out,
                                   .request_time = request_time,
                                   .report = [this](const std::string& line) { keep(line); }});
    ASSERT_TRUE(page) << page.error().text;
    page_ = std::move(*page);
  }
  void keep(const std::string& line) {
    const std::lock_guard lock(mutex_);
    log_.push_back(line);
  }
  [[nodiscard]] std::vector<std::string> log() const {
    const std::lock_guard lock(mutex_);
    return log_;
  }

  [[nodiscard]] httplib::Client browser() const {
    return httplib::Client{"127.0.0.1", page_->port()};
  }

  struct LoggedIn {
    httplib::Headers headers;  ///< cookie and CSRF token
    json me;
  };
  [[nodiscard]] LoggedIn log_in(const std::string& user) const {
    auto client = browser();
    const auto answer = client.Post(
        "/api/login", json{{"user", user}, {"password", kPassword}}.dump(), "application/json");
    if (!answer || answer->status != 200) return {};
    const std::string cookie = answer->get_header_value("Set-Cookie");
    LoggedIn in{{{"Cookie", cookie.substr(0, cookie.find(';'))}}, json::parse(answer->body)};
    in.headers.emplace("X-CSRF-Token", in.me["csrf"].get<std::string>());
    return in;
  }
  [[nodiscard]] int post(const httplib::Headers& headers, const std::string& path,
                         const json& body) const {
    auto client = browser();
    const auto answer = client.Post(path, headers, body.dump(), "application/json");
    return answer ? answer->status : 0;
  }

  mutable std::mutex mutex_;
  std::vector<std::string> log_;
  std::unique_ptr<PageServer> page_;
};

inline void connect_to(std::uint16_t port, const daemon::FileDescriptor& fd) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto* const peer = reinterpret_cast<const sockaddr*>(&to);  // NOLINT
  EXPECT_EQ(::connect(fd.get(), peer, sizeof to), 0);
}

/// A connection from `address`, one of 127.0.0.0/8, that has sent `text`.
inline daemon::FileDescriptor connection(std::uint16_t port, const std::string& text,
                                         const char* address = "127.0.0.1") {
  daemon::FileDescriptor fd{::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  sockaddr_in from{};
  from.sin_family = AF_INET;
  ::inet_pton(AF_INET, address, &from.sin_addr);
  const auto* const own = reinterpret_cast<const sockaddr*>(&from);  // NOLINT
  EXPECT_EQ(::bind(fd.get(), own, sizeof from), 0);
  connect_to(port, fd);
  (void)::send(fd.get(), text.data(), text.size(), MSG_NOSIGNAL);
  return fd;
}

inline std::string get_request(const std::string& file, const std::string& headers = "") {
  return "GET " + file + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

/// Everything until the server closes the connection.
inline std::string all_of(const daemon::FileDescriptor& fd) {
  std::string text;
  std::array<char, 65536> buffer{};
  for (ssize_t n = 0; (n = ::recv(fd.get(), buffer.data(), buffer.size(), 0)) > 0;)
    text.append(buffer.data(), static_cast<std::size_t>(n));
  return text;
}

}  // namespace abbe::web::test
