#include <grp.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pwd.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/control_protocol.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

class Control : public testing::Test {
 protected:
  Control()
      : directory_(std::filesystem::temp_directory_path() /
                   ("abbe-control-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(directory_);
  }
  ~Control() override { std::filesystem::remove_all(directory_); }
  [[nodiscard]] std::filesystem::path socket() const { return directory_ / "control.sock"; }

 private:
  std::filesystem::path directory_;
};

json echo(const json& request, const ControlPeer&) {
  return {{"ok", true}, {"heard", request}};
}

TEST_F(Control, AnswersARequest) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server) << server.error().text;
  const auto answer = ask_daemon(socket(), {{"do", "status"}, {"path", {1.5, 2.5}}});
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ((*answer)["heard"]["path"], json({1.5, 2.5}));
}

/// The error of a user without any rights who asks the daemon at `socket`, from its own process.
std::string error_for_nobody(const std::filesystem::path& socket) {
  std::array<int, 2> ends{};
  EXPECT_EQ(::pipe(ends.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    const bool left = ::geteuid() != 0 || (::setgroups(0, nullptr) == 0 && ::setgid(kNobody) == 0 &&
                                           ::setuid(kNobody) == 0);
    const auto answer = ask_daemon(socket, {{"do", "status"}});
    const std::string text = !left ? "still root" : answer ? "an answer" : answer.error().text;
    (void)!::write(ends[1], text.data(), text.size());
    ::_exit(0);
  }
  ::close(ends[1]);
  std::array<char, 4096> received{};
  const ssize_t length = ::read(ends[0], received.data(), received.size());
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return {received.data(), length > 0 ? static_cast<std::size_t>(length) : 0};
}

TEST_F(Control, AUserWithoutRightsIsToldWhichGroupItNeedsOnlyIfThatHelps) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs a folder of another group, which only root can make";
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  namespace fs = std::filesystem;
  const auto folder = socket().parent_path();
  constexpr gid_t kGroup = 1;
  ASSERT_EQ(::chown(folder.c_str(), 0, kGroup), 0);
  fs::permissions(folder, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec);
  const std::string helps = error_for_nobody(socket());
  fs::permissions(folder, fs::perms::owner_all);
  const std::string does_not = error_for_nobody(socket());
  const struct group* needed = ::getgrgid(kGroup);
  ASSERT_NE(needed, nullptr);
  EXPECT_NE(helps.find(std::string("usermod -aG ") + needed->gr_name + " "), std::string::npos)
      << helps;
  EXPECT_EQ(does_not.find("usermod"), std::string::npos) << does_not;
  EXPECT_NE(does_not.find("this user may not open it"), std::string::npos) << does_not;
  EXPECT_EQ((helps + does_not).find("is abbed running?"), std::string::npos);
}

TEST_F(Control, ARequestLargerThanAnyBufferArrivesWhole) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const std::string big(1u << 20, 'x');
  const auto answer = ask_daemon(socket(), {{"do", "status"}, {"text", big}});
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ((*answer)["heard"]["text"], big);
}

TEST_F(Control, ARefusalArrivesAsTheErrorItWas) {
  for (const auto code : {ErrorCode::DataInsufficient, ErrorCode::Usage, ErrorCode::BadInput,
                          ErrorCode::Io, ErrorCode::Refused}) {
    const auto server = ControlServer::open(socket(), [code](const json&, const ControlPeer&) {
      return refusal({code, "a session is running"});
    });
    ASSERT_TRUE(server);
    const auto answer = ask_daemon(socket(), {{"do", "calibrate"}});
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().code, code);
    EXPECT_EQ(answer.error().text, "a session is running");
  }
}

TEST_F(Control, AnEmptyAnswerIsARefusal) {
  const auto server = ControlServer::open(socket(), [](const json&, const ControlPeer&) {
    return json{{"ok", "perhaps"}};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "status"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Refused);
}

TEST_F(Control, AMemberOfTheWrongTypeIsAnAnswerNotACrash) {
  const auto server = ControlServer::open(socket(), [](const json& request, const ControlPeer&) {
    return json{{"ok", true}, {"n", request.at("n").get<int>()}};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "count"}, {"n", "three"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Usage);
  EXPECT_NE(answer.error().text.find("count"), std::string::npos) << answer.error().text;
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "count"}, {"n", 3}}));
}

TEST_F(Control, AFaultInTheDaemonIsNotReportedAsAWrongRequest) {
  const auto server = ControlServer::open(socket(), [](const json&, const ControlPeer&) -> json {
    throw std::runtime_error{"no space left on device"};
  });
  ASSERT_TRUE(server);
  const auto answer = ask_daemon(socket(), {{"do", "status"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Io);
  EXPECT_NE(answer.error().text.find("failed in the daemon: no space left"), std::string::npos)
      << answer.error().text;
}

// std::bad_alloc outside the handler, or what a library throws: it ends the request, not the
// socket.
TEST_F(Control, AnExceptionOfAnyKindEndsOnlyItsRequest) {
  const auto server = ControlServer::open(socket(), [](const json& request, const ControlPeer&) {
    if (request.contains("bad")) throw 1;  // NOLINT: not derived from std::exception
    return json{{"ok", true}};
  });
  ASSERT_TRUE(server);
  for (const std::string& filler : {std::string{}, std::string(100'000, 'x')}) {  // a long request
    const auto answer = ask_daemon(socket(), {{"do", "status"}, {"bad", true}, {"x", filler}});
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().code, ErrorCode::Io);
    EXPECT_NE(answer.error().text.find("internal error"), std::string::npos) << answer.error().text;
    EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}, {"x", filler}}));
  }
}

TEST_F(Control, ARequestLongerThanTheLimitIsRefusedWithTheLimit) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const std::string too_long(kRequestBounds.bytes + 1, 'x');
  const auto answer = ask_daemon(socket(), {{"do", "status"}, {"x", too_long}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Refused);
  EXPECT_NE(answer.error().text.find("longer than 4194304 bytes"), std::string::npos)
      << answer.error().text;
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
}

TEST_F(Control, BytesThatAreNoTextAreReplacedAndTheSocketStaysOpen) {
  const auto server = ControlServer::open(socket(), [](const json&, const ControlPeer&) {
    return json{{"ok", true}, {"fault", "tracker says \xff\xc3"}};
  });
  ASSERT_TRUE(server);
  for (int i = 0; i < 2; ++i) {
    const auto answer = ask_daemon(socket(), {{"do", "status"}, {"file", "\xfe.csv"}});
    ASSERT_TRUE(answer) << answer.error().text;
    EXPECT_EQ((*answer)["fault"].get<std::string>().find("tracker says "), 0u);
  }
}

TEST_F(Control, ThePeersUserIsTheOneTheKernelReports) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const auto answer =
      ask_daemon(socket(), {{"do", "cancel"}, {"user", "mallory"}, {"who", "anna"}});
  ASSERT_TRUE(answer);
  const passwd* me = ::getpwuid(::getuid());
  EXPECT_EQ((*answer)["heard"]["user"],
            me != nullptr ? me->pw_name : "uid " + std::to_string(::getuid()));
  EXPECT_EQ((*answer)["heard"]["who"], "anna");
}

TEST_F(Control, ThePeersGroupsAreThoseTheKernelReports) {
  std::vector<gid_t> groups;
  const auto server = ControlServer::open(socket(), [&](const json&, const ControlPeer& peer) {
    groups = peer.groups;
    return json{{"ok", peer.uid == ::geteuid()}};
  });
  ASSERT_TRUE(server);
  ASSERT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
  std::vector<gid_t> mine(static_cast<std::size_t>(::getgroups(0, nullptr)));
  ASSERT_GE(::getgroups(static_cast<int>(mine.size()), mine.data()), 0);
  mine.push_back(::getegid());
  EXPECT_EQ(groups, mine);
}

/// A client of its own, for what ask_daemon() would never do.
class RawClient {
 public:
  RawClient() = default;
  ~RawClient() { ::close(fd_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;
  void connect(const std::filesystem::path& path) const {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    ASSERT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  [[nodiscard]] bool send(const std::string& text) const {
    return ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }
  /// All that comes until the server closes.
  [[nodiscard]] std::string read_to_end() const {
    std::string all;
    std::array<char, 4096> buffer{};
    for (ssize_t n = 0; (n = ::read(fd_, buffer.data(), buffer.size())) > 0;)
      all.append(buffer.data(), static_cast<std::size_t>(n));
    return all;
  }
  [[nodiscard]] bool readable(std::chrono::milliseconds time_out) const {
    pollfd wait{fd_, POLLIN, 0};
    return ::poll(&wait, 1, static_cast<int>(time_out.count())) == 1;
  }
  /// How many answers come until `lines` have.
  [[nodiscard]] int read_lines(int lines) const {
    std::array<char, 65536> buffer{};
    int read = 0;
    while (read < lines) {
      const ssize_t n = ::read(fd_, buffer.data(), buffer.size());
      if (n <= 0) break;
      read += static_cast<int>(std::count(buffer.data(), buffer.data() + n, '\n'));
    }
    return read;
  }

 private:
  int fd_ = ::socket(AF_UNIX, SOCK_STREAM, 0);
};

TEST_F(Control, AClientThatNeverReadsDoesNotDelayOthersAndItsAnswersAreLimited) {
  constexpr int kAsked = 200;
  std::atomic<int> answered = 0;
  const auto server = ControlServer::open(socket(), [&](const json& request, const ControlPeer&) {
    if (request["do"] == "much") ++answered;
    return json{{"ok", true}, {"text", std::string(request["do"] == "much" ? 1u << 19 : 1u, 'x')}};
  });

  ASSERT_TRUE(server);
  const RawClient greedy;
  greedy.connect(socket());
  std::string requests;
  for (int i = 0; i < kAsked; ++i) requests += "{\"do\": \"much\"}\n";

  ASSERT_TRUE(greedy.send(requests));
  ASSERT_TRUE(greedy.readable(60s));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(ask_daemon(socket(), {{"do", "little"}}));
  EXPECT_LT(answered, 20);
  EXPECT_EQ(greedy.read_lines(kAsked), kAsked);
}

TEST_F(Control, ALineOfBracketsIsRefusedAndTheServerContinues) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const RawClient client;
  client.connect(socket());
  ASSERT_TRUE(client.send("{\"do\": \"status\", \"x\": " + std::string(140'000, '[') +
                          std::string(140'000, ']') + "}\n"));
  ASSERT_TRUE(client.readable(60s));
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
}

TEST_F(Control, IdleConnectionsDoNotBlockNewOnes) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  const std::vector<RawClient> idle(40);
  for (const auto& client : idle) client.connect(socket());
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "cancel"}}));
  EXPECT_NE(idle.front().read_to_end().find("closed for a newer connection"), std::string::npos);
  EXPECT_TRUE(idle.back().send("{\"do\": \"status\"}\n"));
  EXPECT_EQ(idle.back().read_lines(1), 1);
}

TEST_F(Control, AnIdleConnectionIsClosed) {
  const auto server = ControlServer::open(socket(), echo, {.idle = 20ms});
  ASSERT_TRUE(server);
  const RawClient client;
  client.connect(socket());
  EXPECT_NE(client.read_to_end().find("idle for 20 ms"), std::string::npos);
}

TEST_F(Control, AConnectionThatIsNotAcceptedTimesOut) {
  const int deaf = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strcpy(address.sun_path, socket().c_str());
  ASSERT_EQ(::bind(deaf, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(::listen(deaf, 0), 0);
  const RawClient first;
  first.connect(socket());
  const auto answer = ask_daemon(socket(), {{"do", "status"}}, 20ms);
  ASSERT_FALSE(answer);
  EXPECT_NE(answer.error().text.find("accepted no connection in 20 ms"), std::string::npos)
      << answer.error().text;

  // alive, though deaf: its socket is left to it
  const auto second = ControlServer::open(socket(), echo);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text.find("another daemon"), std::string::npos) << second.error().text;
  ::close(deaf);
}

/// While it exists, this process cannot open further file descriptors.
class NoDescriptors {
 public:
  NoDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int next = ::dup(STDIN_FILENO);  // the lowest that is free
    ::close(next);
    const rlimit none{static_cast<rlim_t>(next), before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

std::chrono::nanoseconds processor_time() {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return std::chrono::seconds{t.tv_sec} + std::chrono::nanoseconds{t.tv_nsec};
}

TEST_F(Control, WithoutFileDescriptorsTheServerAcceptsAConnectionLater) {
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_TRUE(server);
  RawClient client;
  {
    const NoDescriptors none;
    client.connect(socket());
    ASSERT_TRUE(client.send("{\"do\": \"status\"}\n"));
    const auto before = processor_time();
    EXPECT_FALSE(client.readable(300ms));
    EXPECT_LT(processor_time() - before, 150ms);  // a server that does not rest uses all of them
  }
  EXPECT_TRUE(client.readable(60s));
}

TEST_F(Control, ALongRequestDoesNotDelayTheOthers) {
  std::atomic<bool> begun{false}, may_end{false};
  const auto server = ControlServer::open(socket(), [&](const json& request, const ControlPeer&) {
    if (request["do"] == "calibrate") {
      begun = true;
      begun.notify_all();
      may_end.wait(false);
    }
    return json{{"ok", true}, {"did", request["do"]}};
  });
  ASSERT_TRUE(server);
  Result<json> answer = json{};
  std::thread asking([&] {
    answer = ask_daemon(socket(), {{"do", "calibrate"}, {"text", std::string(1u << 20, 'x')}}, 60s);
  });
  begun.wait(false);
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
  may_end = true;
  may_end.notify_all();
  asking.join();
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ((*answer)["did"], "calibrate");
}

TEST_F(Control, AClientThatLeavesDuringItsLongRequestHarmsNobody) {
  std::atomic<bool> begun{false}, may_end{false};
  const auto server = ControlServer::open(socket(), [&](const json& request, const ControlPeer&) {
    if (request["do"] == "calibrate") {
      begun = true;
      begun.notify_all();
      may_end.wait(false);
    }
    return json{{"ok", true}};
  });
  ASSERT_TRUE(server);
  EXPECT_FALSE(
      ask_daemon(socket(), {{"do", "calibrate"}, {"text", std::string(1u << 20, 'x')}}, 200ms));
  begun.wait(false);
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
  may_end = true;
  may_end.notify_all();
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
}

TEST_F(Control, WithoutADaemonTheErrorNamesTheSocket) {
  const auto answer = ask_daemon(socket(), {{"do", "status"}});
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, ErrorCode::Io);
  EXPECT_NE(answer.error().text.find(socket().string()), std::string::npos) << answer.error().text;
}

TEST_F(Control, TwoDaemonsOnOneSocketAreRefused) {
  const auto first = ControlServer::open(socket(), echo);
  ASSERT_TRUE(first);
  const auto second = ControlServer::open(socket(), echo);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().text.find("another daemon"), std::string::npos) << second.error().text;
  EXPECT_TRUE(ask_daemon(socket(), {{"do", "status"}}));
}

TEST_F(Control, ASocketLeftBehindIsReplaced) {
  // What a killed daemon leaves: the socket file without a listener.
  const int dead = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(socket().native().size(), sizeof address.sun_path);
  std::strcpy(address.sun_path, socket().c_str());
  ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(dead);
  EXPECT_TRUE(ControlServer::open(socket(), echo));
}

TEST_F(Control, AFileThatIsNoSocketIsLeftAlone) {
  std::ofstream{socket()} << "precious";
  const auto server = ControlServer::open(socket(), echo);
  ASSERT_FALSE(server);
  EXPECT_NE(server.error().text.find("not a socket"), std::string::npos) << server.error().text;
  EXPECT_TRUE(std::filesystem::is_regular_file(socket()));
}

}  // namespace
}  // namespace abbe::daemon
