/// What a browser, a scanner or a broken network does to the page: limits, and what survives them.

#include <httplib.h>

#undef _res  // a macro of resolv.h, which changes headers of Eigen

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "abbe/web/client_network.hpp"
#include "page_fixture.hpp"

namespace abbe::web {
namespace {

using namespace std::chrono_literals;
using test::all_of;
using test::connection;
using test::get_request;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;

struct PageLimitsTest : test::PageFixture {};

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

std::string post_request(const std::string& headers, const std::string& body) {
  return "POST /api/login HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n" + body;
}

TEST_F(PageLimitsTest, AFloodOfRequestsIsRefusedByName) {
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
  // The connection ends with the refusal: a request that was sent with the refused one gets none.
  std::string many;
  for (int i = 0; i < 100; ++i) many += get_request("/api/me");
  const std::string answers = all_of(connection(page_->port(), many));
  EXPECT_EQ(count_of(answers, "HTTP/1.1 429 "), 1u) << answers;
  EXPECT_THAT(answers, HasSubstr("Retry-After: 2\r\n"));
  EXPECT_THAT(answers, ::testing::EndsWith("too many requests\"}"));
}

TEST_F(PageLimitsTest, APageTooManyIsRefusedByName) {
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

TEST_F(PageLimitsTest, ARangeIsAnsweredWithTheWholeAndNothingBesideIt) {
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
      EXPECT_NE(answer->status, 206) << range << path;
      EXPECT_FALSE(answer->has_header("Content-Range")) << range << path;
    }
  }
}

TEST_F(PageLimitsTest, ALongBodyIsRefusedHoweverItIsSent) {
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

TEST_F(PageLimitsTest, ALongHeadIsRefusedByName) {
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

TEST_F(PageLimitsTest, ManyOrLongHeadersAreRefused) {
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
TEST_F(PageLimitsTest, ALongRangeDoesNoHarm) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::string range = "rANGE: bytes=0-0";
  while (range.size() < 7900) range += ",0-0";
  const auto fd =
      connection(page_->port(), get_request("/icon.svg", range + "\r\nConnection: close\r\n"));
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 200 "));
}

TEST_F(PageLimitsTest, ASlowRequestIsClosedByName) {
  ASSERT_NO_FATAL_FAILURE(start("", kWriteTimeOut, 100ms));
  const auto fd = connection(page_->port(), "GET / HT");
  EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 408 "));
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: a request took longer than 100 ms: closed")));
}

// httplib parses such a body with a regular expression and a search of quadratic time.
TEST_F(PageLimitsTest, OnlyJsonIsReadFromABody) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (const char* type : {"multipart/form-data; boundary=x", "text/plain", ""}) {
    const auto fd =
        connection(page_->port(),
                   post_request(fmt::format("Content-Type: {}\r\nContent-Length: 500\r\n", type),
                                std::string(500, '\r')));
    EXPECT_THAT(all_of(fd), StartsWith("HTTP/1.1 415 ")) << type;
  }
}

TEST_F(PageLimitsTest, ALengthThatIsTooLargeOrUnclearIsRefusedBeforeTheBody) {
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

TEST_F(PageLimitsTest, TheBodyOfAGetIsNotTakenForARequest) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string hidden = get_request("/api/me");
  const auto fd =
      connection(page_->port(),
                 get_request("/", fmt::format("Content-Length: {}\r\n", hidden.size())) + hidden);
  const std::string answers = all_of(fd);
  EXPECT_THAT(answers, StartsWith("HTTP/1.1 400 "));
  EXPECT_EQ(count_of(answers, "HTTP/1.1 "), 1u) << answers;
}

TEST_F(PageLimitsTest, AnAnswerHasOneConnectionHeader) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto posted = connection(
      page_->port(), post_request("Content-Type: application/json\r\nContent-Length: 2\r\n"
                                  "Connection: close\r\n",
                                  "{}"));
  EXPECT_EQ(count_of(all_of(posted), "Connection: "), 1u);
  const auto got = connection(page_->port(), get_request("/api/me", "Connection: close\r\n"));
  EXPECT_EQ(count_of(all_of(got), "Connection: "), 1u);
}

TEST_F(PageLimitsTest, AnswersRequestsThatAreSentTogether) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto fd = connection(page_->port(), get_request("/api/me") + get_request("/icon.svg") +
                                                get_request("/api/me", "Connection: close\r\n"));
  EXPECT_EQ(count_of(all_of(fd), "HTTP/1.1 200 "), 3u);
}

TEST_F(PageLimitsTest, AnOldClientGetsAnAnswerAndTheEnd) {
  ASSERT_NO_FATAL_FAILURE(start());
  const std::string old = " HTTP/1.0\r\nHost: localhost\r\n\r\n";
  EXPECT_THAT(all_of(connection(page_->port(), "GET /api/me" + old)), HasSubstr(" 200 "));
  EXPECT_THAT(all_of(connection(page_->port(), "GET /events" + old)), HasSubstr(" 505 "));
}

TEST_F(PageLimitsTest, WhatIsNotHttpIsClosed) {
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

TEST_F(PageLimitsTest, AnErrorOfAcceptIsNamedAndPasses) {
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

TEST_F(PageLimitsTest, AServerThatCannotListenAnyMoreNamesItAlthoughAPageIsOpen) {
  ASSERT_NO_FATAL_FAILURE(start());
  const auto events = connection(page_->port(), get_request("/events"));
  char first = 0;
  ASSERT_EQ(::recv(events.get(), &first, 1, 0), 1);
  ASSERT_EQ(::shutdown(listener_at(page_->port()), SHUT_RDWR), 0);
  while (!page_->ended()) std::this_thread::yield();
  EXPECT_THAT(page_->fault(), HasSubstr("connections cannot be accepted: Invalid argument"));
}

TEST_F(PageLimitsTest, OneAddressLeavesPlacesForPagesOfOthers) {
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

// Of several addresses, so that all places are taken; none of them reads or reports.
TEST_F(PageLimitsTest, StreamsThatNobodyReadsGiveWayToAPage) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 4\n"));
  std::vector<daemon::FileDescriptor> unread;
  for (const char* const address : {"127.0.0.1", "127.0.0.1", "127.0.0.2", "127.0.0.2"})
    unread.push_back(connection(page_->port(), get_request("/events"), address));
  // From many addresses, so that none of them exceeds the limit of requests.
  std::string status;
  for (int i = 0; status != "200"; ++i) {
    const std::string address = fmt::format("127.0.{}.{}", 1 + i / 200 % 200, 1 + i % 200);
    const auto page = connection(page_->port(), get_request("/events"), address.c_str());
    std::array<char, 12> head{};
    (void)::recv(page.get(), head.data(), head.size(), MSG_WAITALL);
    status = std::string{head.data() + 9, 3};
    ASSERT_TRUE(status == "200" || status == "503") << status;
  }
}

TEST_F(PageLimitsTest, APageReportsThatItReadsByTheNumberOfItsPlace) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 1\n"));
  const auto page = connection(page_->port(), get_request("/events"));
  std::string text;
  std::array<char, 4096> buffer{};
  while (text.find("event: place") == std::string::npos ||
         text.find("}", text.find("event: place")) == std::string::npos) {
    const ssize_t n = ::recv(page.get(), buffer.data(), buffer.size(), 0);
    ASSERT_GT(n, 0);
    text.append(buffer.data(), static_cast<std::size_t>(n));
  }
  const auto number = text.find("\"number\":", text.find("event: place")) + 9;
  const std::string place = text.substr(number, text.find('}', number) - number);
  const auto reported = browser().Get("/api/reading/" + place);
  ASSERT_TRUE(reported);
  EXPECT_EQ(reported->status, 200);
  EXPECT_EQ(browser().Get("/api/reading/x")->status, 400);
}

TEST_F(PageLimitsTest, EachWrongPasswordHasALineInTheLog) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (int i = 0; i < 8; ++i)
    (void)browser().Post("/api/login", R"({"user": "view", "password": "wrong password"})",
                         "application/json");
  const auto lines = log();
  const auto with = [&lines](const std::string& part) {
    return std::ranges::count_if(
        lines, [&part](const std::string& l) { return l.find(part) != std::string::npos; });
  };
  EXPECT_EQ(with("log in as \"view\" refused: wrong name or password"), 5);
  EXPECT_EQ(with("log in as \"view\" refused: too many wrong passwords: wait 60 s"), 1);
}

TEST_F(PageLimitsTest, ManyConnectionsOfOneAddressLeaveAnotherItsAnswer) {
  ASSERT_NO_FATAL_FAILURE(start());
  std::vector<daemon::FileDescriptor> silent;
  for (int i = 0; i < 100; ++i) silent.push_back(connection(page_->port(), "GET / HT"));
  const auto other =
      connection(page_->port(), get_request("/api/me", "Connection: close\r\n"), "127.0.0.2");
  EXPECT_THAT(all_of(other), HasSubstr(" 200 "));
  EXPECT_THAT(log(), Contains(HasSubstr("127.0.0.1: more than 48 connections: closed")));
}

// Also of connections that arrive before the threads have taken the first ones.
TEST_F(PageLimitsTest, OnlyAConnectionBeyondThoseServedAndWaitingIsClosed) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 1\n", kWriteTimeOut, 1h));
  constexpr int kServedAndWaiting = 65 + 64;
  std::vector<daemon::FileDescriptor> silent;
  for (const char* const address : {"127.0.0.1", "127.0.0.2", "127.0.0.3"})
    for (int i = 0; i < kServedAndWaiting / 3; ++i)
      silent.push_back(connection(page_->port(), "GET / HT", address));
  EXPECT_EQ(all_of(connection(page_->port(), "GET / HT", "127.0.0.4")), "");
  EXPECT_THAT(log(), ElementsAre(HasSubstr("127.0.0.4: closed: 64 connections wait already")));
}

// Of each address fewer than its limit, together more than there are threads.
TEST_F(PageLimitsTest, SilentConnectionsOfSeveralAddressesEndWhileAnotherWaits) {
  ASSERT_NO_FATAL_FAILURE(start("most_pages = 1\n", kWriteTimeOut, 1h));
  std::vector<daemon::FileDescriptor> silent;
  for (const char* const address : {"127.0.0.1", "127.0.0.2"})
    for (int i = 0; i < 45; ++i) silent.push_back(connection(page_->port(), "GET / HT", address));
  const auto other =
      connection(page_->port(), get_request("/api/me", "Connection: close\r\n"), "127.0.0.3");
  EXPECT_THAT(all_of(other), HasSubstr(" 200 "));
  EXPECT_THAT(log(),
              Contains(HasSubstr("silent or slow for 2000 ms while other connections wait")));
}

TEST_F(PageLimitsTest, DownloadsThatNobodyReadsEndAndOthersGoOn) {
  constexpr std::size_t kBytes = 32u << 20;
  std::filesystem::create_directories(folder_ / "data/recordings");
  write("data/recordings/a.mcap", std::string(kBytes, 'x'));
  ASSERT_NO_FATAL_FAILURE(start("", 1s));  // a browser on a loaded computer is slower than 200 ms
  std::vector<daemon::FileDescriptor> deaf;
  for (int i = 0; i < 4; ++i)
    deaf.push_back(connection(page_->port(), get_request("/recordings/a.mcap")));

  auto client = browser();
  std::size_t received = 0;
  for (int i = 0; i < 100 && received == 0; ++i) {
    const auto answer = client.Get("/recordings/a.mcap", {{"Range", "bytes=0-"}});
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->has_header("Content-Range"), answer->status == 206) << answer->status;
    if (answer->status == 206) received = answer->body.size();
    if (received == 0) std::this_thread::sleep_for(50ms);
  }
  EXPECT_EQ(received, kBytes);
  EXPECT_EQ(client.Get("/api/me")->status, 200);
}

TEST(ClientNetwork, IsTheAddressOrTheNetworkOfIpv6) {
  EXPECT_EQ(client_network("192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(client_network("2001:db8:0:1:2:3:4:5"), "2001:db8:0:1::/64");
  EXPECT_EQ(client_network("2001:db8:0:1:ffff::9"), client_network("2001:db8:0:1::8"));
  EXPECT_NE(client_network("2001:db8:0:2::9"), client_network("2001:db8:0:1::9"));
  EXPECT_EQ(client_network("::1"), "::/64");
  EXPECT_EQ(client_network("::ffff:192.0.2.7"), "192.0.2.7");
  EXPECT_EQ(client_network(""), "");
}

}  // namespace
}  // namespace abbe::web
