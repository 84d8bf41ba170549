/// The page over HTTP, from the point of view of browsers: what they see without and with a log in,
/// and what they cannot do. abbed does not run here; tests/integration/spine/web_test.cpp has it.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <arpa/inet.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/base/file_descriptor.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/web/certificate.hpp"
#include "abbe/web/page_server.hpp"
#include "web_folder.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::kPassword;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

struct PageServerTest : test::WebFolder {
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

TEST_F(PageServerTest, ServesThePageWithItsLibrariesAndStrictHeaders) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  for (const char* file : {"/", "/main.js", "/style.css", "/three.min.js", "/chart.min.js"}) {
    const auto answer = client.Get(file);
    ASSERT_TRUE(answer) << file;
    EXPECT_EQ(answer->status, 200) << file;
    EXPECT_FALSE(answer->body.empty()) << file;
    const std::string policy = answer->get_header_value("Content-Security-Policy");
    EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
    EXPECT_THAT(policy, Not(HasSubstr("unsafe")));
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
  }
  for (const char* file :
       {"/etc/passwd", "/../abbed.toml", "/recordings/../users", "/recordings/%2e%2e%2fusers"})
    EXPECT_GE(client.Get(file)->status, 400) << file;
}

TEST_F(PageServerTest, ShowsWithoutALogInAndChangesNothing) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  const auto me = client.Get("/api/me");
  ASSERT_TRUE(me);
  EXPECT_TRUE(json::parse(me->body)["may_view"]);
  EXPECT_EQ(client.Get("/api/history")->status, 200);
  for (const char* path :
       {"/api/activate", "/api/rollback", "/api/calibrate", "/api/cancel", "/api/replay"})
    EXPECT_EQ(post({}, path, json::object()), 401) << path;
}

TEST_F(PageServerTest, ShowsNothingBeforeALogInIfSoConfigured) {
  ASSERT_NO_FATAL_FAILURE(start("view_without_login = false\n"));
  auto client = browser();
  for (const char* path :
       {"/api/history", "/api/status", "/events", "/api/configuration", "/recordings/a.mcap"})
    EXPECT_EQ(client.Get(path)->status, 401) << path;
  const auto in = log_in("view");
  EXPECT_EQ(client.Get("/api/history", in.headers)->status, 200);
}

TEST_F(PageServerTest, ARoleMayDoWhatItNamesAndNoMore) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto view = log_in("view"), calibrate = log_in("calibrate"),
             administer = log_in("administer");
  const json id{{"id", "0123456789abcdef"}};
  EXPECT_EQ(post(view.headers, "/api/cancel", json::object()), 403);
  EXPECT_EQ(post(calibrate.headers, "/api/activate", id), 403);
  EXPECT_THAT(log(),
              Contains(HasSubstr("/api/activate refused to calibrate: needs the role administer")));
  // Allowed, but abbed does not run.
  EXPECT_EQ(post(calibrate.headers, "/api/cancel", json::object()), 503);
  EXPECT_EQ(post(administer.headers, "/api/activate", id), 503);
}

TEST_F(PageServerTest, AChangeNeedsTheTokenAndComesFromThisSite) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("administer");
  httplib::Headers without = in.headers;
  without.erase("X-CSRF-Token");
  EXPECT_EQ(post(without, "/api/cancel", json::object()), 403);
  httplib::Headers other = in.headers;
  other.emplace("Origin", "https://evil.example");
  EXPECT_EQ(post(other, "/api/cancel", json::object()), 403);
  EXPECT_THAT(log(), Contains(HasSubstr("another site, https://evil.example")));
  // A form of another site cannot send this type.
  auto client = browser();
  EXPECT_EQ(client.Post("/api/cancel", in.headers, "{}", "text/plain")->status, 415);
  EXPECT_EQ(post(in.headers, "/api/cancel", json::object()), 503);
}

TEST_F(PageServerTest, ARequestForAnotherNameIsRefused) {
  ASSERT_NO_FATAL_FAILURE(start("host_names = [\"press3.example\"]\n"));
  auto client = browser();
  EXPECT_EQ(client.Get("/api/me", {{"Host", "evil.example"}})->status, 421);
  EXPECT_EQ(client.Get("/api/me", {{"Host", "press3.example:8440"}})->status, 200);
  EXPECT_THAT(log(), Contains(HasSubstr("\"evil.example\" is not a name of this page")));
}

TEST_F(PageServerTest, AFloodOfRequestsIsRefusedByName) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  client.set_keep_alive(true);
  int refused = 0;
  for (int i = 0; i < 400; ++i) {
    const auto answer = client.Get("/api/me");
    if (answer && answer->status == 429) ++refused;
  }
  EXPECT_GT(refused, 50);
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: more than 40 requests/s: refused")));
}

TEST_F(PageServerTest, APageTooManyIsRefusedByName) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 1\n"));
  std::atomic<bool> open{false}, done{false};
  std::thread first([&] {
    auto client = browser();
    (void)client.Get("/events", [&](const char*, std::size_t) {
      open = true;
      open.notify_all();
      return !done;
    });
  });
  open.wait(false);
  auto client = browser();
  const auto second = client.Get("/events");
  done = true;
  first.join();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->status, 503);
  EXPECT_THAT(log(), Contains(HasSubstr("page refused: 1 are open")));
}

void connect_to(std::uint16_t port, const daemon::FileDescriptor& fd) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const auto* const peer = reinterpret_cast<const sockaddr*>(&to);  // NOLINT
  EXPECT_EQ(::connect(fd.get(), peer, sizeof to), 0);
}

/// A connection from `address`, one of 127.0.0.0/8, that has sent `text`.
daemon::FileDescriptor connection(std::uint16_t port, const std::string& text,
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

std::string get_request(const std::string& file, const std::string& headers = "") {
  return "GET " + file + " HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

/// Everything until the server closes the connection.
std::string all_of(const daemon::FileDescriptor& fd) {
  std::string text;
  std::array<char, 65536> buffer{};
  for (ssize_t n = 0; (n = ::recv(fd.get(), buffer.data(), buffer.size(), 0)) > 0;)
    text.append(buffer.data(), static_cast<std::size_t>(n));
  return text;
}

TEST_F(PageServerTest, ARangeIsAnsweredWithTheWholeAndNothingBesideIt) {
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  const std::string whole = client.Get("/icon.svg")->body;
  ASSERT_FALSE(whole.empty());
  for (const char* range :
       {"bytes=0-9999", "bytes=20000-", "bytes=0-60000000", "bytes=0-1,5-9999"}) {
    for (const char* path : {"/icon.svg", "/api/me", "/recordings/none.mcap", "/nothing"}) {
      const std::string without = client.Get(path)->body;
      const auto answer = client.Get(path, {{"Range", range}});
      ASSERT_TRUE(answer) << range << path;
      EXPECT_EQ(answer->body, without) << range << path;
    }
  }
}

TEST_F(PageServerTest, ALongBodyIsRefusedHoweverItIsSent) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string head =
      "POST /api/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
  std::string chunks;
  for (int i = 0; i < 40; ++i) chunks += "10000\r\n" + std::string(0x10000, ' ') + "\r\n";
  const auto chunked = connection(page_->port(), "");
  std::thread sending([&] {
    const std::string text = head + "Transfer-Encoding: chunked\r\n\r\n" + chunks;
    (void)::send(chunked.get(), text.data(), text.size(), MSG_NOSIGNAL);
  });
  (void)all_of(chunked);
  sending.join();
  EXPECT_THAT(log(), Contains(HasSubstr("request of more than")));

  const auto packed =
      connection(page_->port(), head + "Content-Encoding: gzip\r\nContent-Length: 2\r\n\r\nxx");
  EXPECT_THAT(all_of(packed), HasSubstr(" 415 "));
}

TEST_F(PageServerTest, ALongHeadIsRefusedByName) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto fd = connection(page_->port(), "");
  std::thread sending([&] {
    const std::string line = "GET /" + std::string(3u << 20, 'a');
    (void)::send(fd.get(), line.data(), line.size(), MSG_NOSIGNAL);
  });
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 431 "));
  sending.join();
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: a request with more than 32768 bytes")));
}

TEST_F(PageServerTest, ManyOrLongHeadersAreRefused) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::string many;
  for (int i = 0; i < 200; ++i) many += "a:\r\n";
  EXPECT_THAT(all_of(connection(page_->port(), get_request("/", many))),
              StartsWith("HTTP/1.1 431 "));
  const std::string line = "a: " + std::string(10'000, 'a') + "\r\n";
  EXPECT_THAT(all_of(connection(page_->port(), get_request("/", line))),
              StartsWith("HTTP/1.1 431 "));
}

// httplib matches this header with a regular expression.
TEST_F(PageServerTest, ALongRangeDoesNoHarm) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::string range = "rANGE: bytes=0-0";
  while (range.size() < 7900) range += ",0-0";
  const auto fd =
      connection(page_->port(), get_request("/icon.svg", range + "\r\nConnection: close\r\n"));
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 200 "));
}

TEST_F(PageServerTest, ASlowRequestIsClosedByName) {
  ASSERT_NO_FATAL_FAILURE(start("", kWriteTimeOut, 100ms));
  const auto fd = connection(page_->port(), "GET / HT");
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 408 "));
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: a request took longer than 100 ms: closed")));
}

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

std::string post_request(const std::string& headers, const std::string& body) {
  return "POST /api/login HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n" + body;
}

// httplib parses such a body with a regular expression and a search of quadratic time.
TEST_F(PageServerTest, OnlyJsonIsReadFromABody) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (const char* type : {"multipart/form-data; boundary=x", "text/plain", ""}) {
    const auto fd =
        connection(page_->port(),
                   post_request(fmt::format("Content-Type: {}\r\nContent-Length: 500\r\n", type),
                                std::string(500, '\r')));
    EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 415 ")) << type;
  }
}

TEST_F(PageServerTest, ALengthThatIsTooLargeOrUnclearIsRefusedBeforeTheBody) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string json = "Content-Type: application/json\r\n";
  const auto answer = [&](const std::string& headers, const std::string& body) {
    return all_of(connection(page_->port(), post_request(json + headers, body)));
  };
  EXPECT_THAT(answer("Content-Length: 99999999999999999999\r\n", "{}"),
              StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(answer("Content-Length: -1\r\n", "{}"), StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(answer("Content-Length: 2\r\nContent-Length: 3\r\n", "{}"),
              StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(answer("Content-Length: 2\r\nTransfer-Encoding: chunked\r\n", "{}"),
              StartsWith("HTTP/1.1 400 "));
  EXPECT_THAT(answer("", ""), StartsWith("HTTP/1.1 400 "));
  // The answer arrives although the client still sends.
  EXPECT_THAT(answer("Content-Length: 2000000\r\n", std::string(2'000'000, ' ')),
              StartsWith("HTTP/1.1 413 "));
}

TEST_F(PageServerTest, TheBodyOfAGetIsNotTakenForARequest) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string hidden = get_request("/api/me");
  const auto fd =
      connection(page_->port(),
                 get_request("/", fmt::format("Content-Length: {}\r\n", hidden.size())) + hidden);
  const std::string answers = all_of(fd);
  EXPECT_THAT(answers, StartsWith("HTTP/1.1 400 "));
  EXPECT_EQ(count_of(answers, "HTTP/1.1 "), 1u) << answers;
}

TEST_F(PageServerTest, AnAnswerHasOneConnectionHeader) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto posted = connection(
      page_->port(), post_request("Content-Type: application/json\r\nContent-Length: 2\r\n"
                                  "Connection: close\r\n",
                                  "{}"));
  EXPECT_EQ(count_of(all_of(posted), "Connection: "), 1u);
  const auto got = connection(page_->port(), get_request("/api/me", "Connection: close\r\n"));
  EXPECT_EQ(count_of(all_of(got), "Connection: "), 1u);
}

TEST_F(PageServerTest, AnswersRequestsThatAreSentTogether) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto fd = connection(page_->port(), get_request("/api/me") + get_request("/icon.svg") +
                                                get_request("/api/me", "Connection: close\r\n"));
  EXPECT_EQ(count_of(all_of(fd), "HTTP/1.1 200 "), 3u);
}

TEST_F(PageServerTest, AnOldClientGetsAnAnswerAndTheEnd) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string old = " HTTP/1.0\r\nHost: localhost\r\n\r\n";
  EXPECT_THAT(all_of(connection(page_->port(), "GET /api/me" + old)), HasSubstr(" 200 "));
  EXPECT_THAT(all_of(connection(page_->port(), "GET /events" + old)), HasSubstr(" 505 "));
}

TEST_F(PageServerTest, WhatIsNotHttpIsClosed) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string garbage = "\x16\x03\x01 nothing\r\nGET / HTTP/1.1\r\n\r\n";
  EXPECT_EQ(count_of(all_of(connection(page_->port(), garbage)), "HTTP/1.1 "), 1u);
}

/// The listening socket of this process at the port.
int listener_at(std::uint16_t port) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const int fd = std::stoi(entry.path().filename());
    int listens = 0;
    socklen_t size = sizeof listens;
    if (::getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0 || listens == 0) continue;
    sockaddr_in at{};
    size = sizeof at;
    if (::getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size) == 0 &&  // NOLINT
        ntohs(at.sin_port) == port)
      return fd;
  }
  return -1;
}

/// Puts a UDP socket with a datagram in the place of a listening socket: accept() then fails, but
/// the descriptor is valid. (Without free descriptors, the sanitizers themselves would fail.)
class FailingListener {
 public:
  explicit FailingListener(int listener) : listener_(listener), kept_(::dup(listener)) {
    const daemon::FileDescriptor udp{::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof at;
    auto* const any = reinterpret_cast<sockaddr*>(&at);  // NOLINT: the interface of sockets
    EXPECT_EQ(::bind(udp.get(), any, size), 0);
    EXPECT_EQ(::getsockname(udp.get(), any, &size), 0);
    EXPECT_EQ(::sendto(udp.get(), "x", 1, 0, any, size), 1);
    EXPECT_EQ(::dup2(udp.get(), listener_), listener_);
  }
  FailingListener(const FailingListener&) = delete;
  FailingListener& operator=(const FailingListener&) = delete;
  ~FailingListener() { ::dup2(kept_.get(), listener_); }

 private:
  int listener_;
  daemon::FileDescriptor kept_;
};

TEST_F(PageServerTest, AnErrorOfAcceptIsNamedAndPasses) {
  ASSERT_NO_FATAL_FAILURE(start());
  {
    const FailingListener failing{listener_at(page_->port())};
    while (page_->fault().empty()) std::this_thread::yield();
    EXPECT_THAT(page_->fault(), HasSubstr("cannot be accepted: Operation not supported: trying"));
    EXPECT_FALSE(page_->ended());
  }
  const auto fd = connection(page_->port(), get_request("/api/me", "Connection: close\r\n"));
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 200 "));
  EXPECT_EQ(page_->fault(), "");
  EXPECT_THAT(log(),
              Contains(HasSubstr("connections cannot be accepted: Operation not supported")));
}

TEST_F(PageServerTest, AServerThatCannotListenAnyMoreNamesItAlthoughAPageIsOpen) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto events = connection(page_->port(), get_request("/events"));
  char first = 0;
  ASSERT_EQ(::recv(events.get(), &first, 1, 0), 1);
  ASSERT_EQ(::shutdown(listener_at(page_->port()), SHUT_RDWR), 0);
  while (!page_->ended()) std::this_thread::yield();
  EXPECT_THAT(page_->fault(), HasSubstr("connections cannot be accepted: Invalid argument"));
}

TEST_F(PageServerTest, OneAddressLeavesPlacesForPagesOfOthers) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 4\n"));
  std::vector<daemon::FileDescriptor> open;
  const auto opens = [&](const char* address) {
    open.push_back(connection(page_->port(), get_request("/events"), address));
    std::array<char, 12> status{};
    (void)::recv(open.back().get(), status.data(), status.size(), MSG_WAITALL);
    return std::string{status.data() + 9, 3};
  };
  for (int i = 0; i < 3; ++i) EXPECT_EQ(opens("127.0.0.1"), "200");
  EXPECT_EQ(opens("127.0.0.1"), "503");
  EXPECT_EQ(opens("127.0.0.2"), "200");
  EXPECT_EQ(opens("127.0.0.2"), "503");
  EXPECT_THAT(log(), Contains(HasSubstr("page refused: 3 are open on this computer")));
}

TEST_F(PageServerTest, ManyConnectionsOfOneAddressLeaveAnotherItsAnswer) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::vector<daemon::FileDescriptor> silent;
  for (int i = 0; i < 100; ++i) silent.push_back(connection(page_->port(), "GET / HT"));
  const auto other =
      connection(page_->port(), get_request("/api/me", "Connection: close\r\n"), "127.0.0.2");
  EXPECT_THAT(all_of(other), HasSubstr(" 200 "));
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: more than 48 connections: closed")));
}

TEST_F(PageServerTest, EventsEndWhenTheirUserLogsOut) {
  ASSERT_NO_FATAL_FAILURE(start("view_without_login = false\n"));
  const auto in = log_in("view");
  const auto cookie = "Cookie: " + in.headers.find("Cookie")->second + "\r\n";
  const auto events = connection(page_->port(), get_request("/events", cookie));
  char first = 0;
  ASSERT_EQ(::recv(events.get(), &first, 1, 0), 1);
  EXPECT_EQ(first, 'H');  // of HTTP
  EXPECT_EQ(post(in.headers, "/api/logout", json::object()), 200);
  EXPECT_THAT(all_of(events), HasSubstr(" 200 "));  // and then the end
}

TEST_F(PageServerTest, ARecordingWithAForgedNameIsNotServed) {
  std::filesystem::create_directories(folder_ / "data/recordings");
  write("data/recordings/secret", "secret");
  std::filesystem::create_symlink(folder_ / "users", folder_ / "data/recordings/link.mcap");
  ASSERT_EQ(::mkfifo((folder_ / "data/recordings/pipe.mcap").c_str(), 0600), 0);
  ASSERT_NO_FATAL_FAILURE(start());
  auto client = browser();
  for (const char* name : {"secret", "secret%00.mcap", "link.mcap", "pipe.mcap", "..%2fusers"})
    EXPECT_EQ(client.Get(std::string{"/recordings/"} + name)->status, 404) << name;
  EXPECT_EQ(json::parse(client.Get("/api/recordings")->body), json::array());
}

TEST_F(PageServerTest, DownloadsThatNobodyReadsEndAndOthersGoOn) {
  constexpr std::size_t kBytes = 32u << 20;
  std::filesystem::create_directories(folder_ / "data/recordings");
  write("data/recordings/a.mcap", std::string(kBytes, 'x'));
  ASSERT_NO_FATAL_FAILURE(start("", 200ms));
  std::vector<daemon::FileDescriptor> deaf;
  for (int i = 0; i < 4; ++i)
    deaf.push_back(connection(page_->port(), get_request("/recordings/a.mcap")));

  auto client = browser();
  std::size_t received = 0;
  for (int i = 0; i < 100 && received == 0; ++i) {
    const auto answer = client.Get("/recordings/a.mcap");
    ASSERT_TRUE(answer);
    if (answer->status == 200) received = answer->body.size();
    if (received == 0) std::this_thread::sleep_for(50ms);
  }
  EXPECT_EQ(received, kBytes);
  EXPECT_EQ(client.Get("/api/me")->status, 200);
}

/// abbed as the page sees it: `answers` gives the answer to a request, by "do".
std::unique_ptr<daemon::ControlServer> fake_abbed(const std::filesystem::path& folder,
                                                  std::map<std::string, json> answers) {
  std::filesystem::create_directories(folder / "run");
  auto server = daemon::ControlServer::open(
      folder / "run/control.sock",
      [answers = std::move(answers)](const json& request, const daemon::ControlPeer&) {
        const auto found = answers.find(request.at("do").get<std::string>());
        if (found != answers.end()) return found->second;
        return daemon::refusal({daemon::ErrorCode::Refused, "not in this test"});
      });
  EXPECT_TRUE(server);
  return std::move(*server);
}

TEST_F(PageServerTest, AChangeDoesNotWaitForeverForAnotherOneNorDoesTheEnd) {
  const auto abbed = fake_abbed(folder_, {{"activate", {{"ok", true}, {"change", 1}}},
                                          {"change", {{"ok", true}, {"change", 1}}}});
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("administer");
  const json id{{"id", "0123456789abcdef"}};
  std::vector<int> statuses(2);
  std::vector<std::thread> users;
  for (int& status : statuses)
    users.emplace_back([&] { status = post(in.headers, "/api/activate", id); });
  // One of them waits for the store, which never answers; the other one for its turn.
  while (statuses[0] == 0 && statuses[1] == 0) std::this_thread::sleep_for(10ms);
  page_.reset();
  for (std::thread& user : users) user.join();
  EXPECT_THAT(statuses, Each(503));
}

TEST_F(PageServerTest, AnAnswerOfAbbedWithoutPositionsIsAnEventWithoutPositions) {
  const auto abbed = fake_abbed(folder_, {{"status", {{"ok", true}}}, {"live", {{"ok", true}}}});
  ASSERT_NO_FATAL_FAILURE(start());
  const auto events = connection(page_->port(), get_request("/events"));
  std::string seen;
  std::array<char, 4096> buffer{};
  for (ssize_t n = 0; seen.find("event: live\ndata: []\n") == std::string::npos &&
                      (n = ::recv(events.get(), buffer.data(), buffer.size(), 0)) > 0;)
    seen.append(buffer.data(), static_cast<std::size_t>(n));
  EXPECT_THAT(seen, HasSubstr("event: live\ndata: []\n"));
}

TEST_F(PageServerTest, ABodyThatIsTooLargeOrNotJsonIsRefused) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("calibrate");
  auto client = browser();
  EXPECT_EQ(client.Post("/api/calibrate", in.headers, "{", "application/json")->status, 400);
  EXPECT_EQ(client.Post("/api/calibrate", in.headers, "[]", "application/json")->status, 400);
  const auto large =
      client.Post("/api/calibrate", in.headers, std::string(2u << 20, ' '), "application/json");
  EXPECT_TRUE(!large || large->status == 413) << large->status;
  EXPECT_EQ(client.Get("/api/me")->status, 200);
}

TEST_F(PageServerTest, AFaultInAFileForACalibrationIsNamedWithItsLine) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto in = log_in("calibrate");
  auto client = browser();
  const auto fault = [&](const json& body) {
    const auto answer = client.Post("/api/calibrate", in.headers, body.dump(), "application/json");
    return answer ? answer->body : "no answer";
  };
  EXPECT_THAT(fault({{"method", "otf"},
                     {"path", {{"file", "p.csv"}, {"text", "x_mm,y_mm,z_mm\n0,0,0\n1,b,0\n"}}}}),
              HasSubstr("p.csv:3"));
  EXPECT_THAT(fault({{"method", "evemu"},
                     {"calibrator", {{"file", "c.toml"}, {"text", "[calibrator]\nname = 1\n"}}}}),
              HasSubstr("c.toml:2"));
  EXPECT_THAT(fault({{"method", "magic"}}), HasSubstr("must be otf, evemu or mfb"));
  EXPECT_THAT(fault(json::object()), HasSubstr("method"));
}

template <auto free>
struct Free {
  template <class T>
  void operator()(T* object) const {
    free(object);
  }
};

/// Writes a certificate for localhost that signs itself, and its key. `until`: as ASN.1 has it.
void write_certificate(const std::filesystem::path& folder, const char* until) {
  const std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>> key{EVP_EC_gen("P-256")};
  const std::unique_ptr<X509, Free<X509_free>> certificate{X509_new()};
  X509_set_version(certificate.get(), X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), -2L * 86400);
  ASSERT_EQ(ASN1_TIME_set_string(X509_getm_notAfter(certificate.get()), until), 1);
  X509_NAME* const name = X509_get_subject_name(certificate.get());
  const auto* const common_name = reinterpret_cast<const unsigned char*>("localhost");  // NOLINT
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, common_name, -1, -1, 0);
  X509_set_issuer_name(certificate.get(), name);
  X509_set_pubkey(certificate.get(), key.get());
  ASSERT_GT(X509_sign(certificate.get(), key.get(), EVP_sha256()), 0);

  const std::unique_ptr<BIO, Free<BIO_free>> to{BIO_new_file((folder / "web.pem").c_str(), "w")},
      key_to{BIO_new_file((folder / "key.pem").c_str(), "w")};
  ASSERT_EQ(PEM_write_bio_X509(to.get(), certificate.get()), 1);
  ASSERT_EQ(
      PEM_write_bio_PrivateKey(key_to.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr), 1);
}

constexpr const char* kTls = "certificate = \"web.pem\"\nkey = \"key.pem\"\n";

TEST_F(PageServerTest, AnExpiredCertificateIsRefusedWithItsDate) {
  write_certificate(folder_, "240229120000Z");
  write_config(std::string{"port = 0\n"} + kTls);
  auto read = settings();
  ASSERT_TRUE(read) << read.error().text;
  const auto page = PageServer::start({.settings = std::move(*read),
                                       .config_file = folder_ / "abbed.toml",
                                       .report = [](const std::string&) {}});
  ASSERT_FALSE(page);
  EXPECT_THAT(page.error().text, HasSubstr("web.pem expired on 2024-02-29"));
}

TEST_F(PageServerTest, ACertificateMayBeValidUntilTheYear9999) {
  write_certificate(folder_, "99991231235959Z");
  const auto dates = read_certificate(folder_ / "web.pem");
  ASSERT_TRUE(dates);
  EXPECT_EQ(day_of(dates->until), "9999-12-31");
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_EQ(page_->fault(), "");
}

TEST_F(PageServerTest, AKeyThatOthersMayReadIsNamed) {
  write_certificate(folder_, "20991231235959Z");
  ::chmod((folder_ / "key.pem").c_str(), 0640);
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_THAT(log(), Not(Contains(HasSubstr("key.pem"))));
  ::chmod((folder_ / "key.pem").c_str(), 0644);
  page_.reset();
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  EXPECT_THAT(log(), Contains(AllOf(HasSubstr("key.pem: other users may read it"),
                                    HasSubstr("chmod 0640"))));
}

TEST_F(PageServerTest, ServesOverTls) {
  write_certificate(folder_, "20991231235959Z");
  ASSERT_NO_FATAL_FAILURE(start(kTls));
  httplib::SSLClient client{"127.0.0.1", page_->port()};
  client.enable_server_certificate_verification(false);
  const auto me = client.Get("/api/me");
  ASSERT_TRUE(me);
  EXPECT_EQ(me->status, 200);
  const auto in = client.Post("/api/login", json{{"user", "view"}, {"password", kPassword}}.dump(),
                              "application/json");
  ASSERT_TRUE(in);
  EXPECT_THAT(in->get_header_value("Set-Cookie"), HasSubstr("; Secure"));
}

}  // namespace
}  // namespace abbe::web
