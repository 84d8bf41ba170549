#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "abbe/messages/dds_link.hpp"
#include "shop_floor.hpp"

namespace abbe::test {
namespace {

struct AbbeDds : ShopFloor {
  int exit_code(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), ABBE_DDS_PROGRAM);
    return Process(std::move(arguments)).wait_for_end(std::chrono::seconds{60});
  }
  /// An abbed.toml whose sockets are in the folder of the test.
  void write_config(const std::string& supervise) {
    std::string text = "[machine]\nname = \"mill\"\nchain = \"[w b X Y Z t]\"\n";
    for (const char axis : {'X', 'Y', 'Z'})
      text += fmt::format("[axes.{}]\nmin_mm = 0\nmax_mm = 100\n", axis);
    text += fmt::format(
        "[dds]\nsupervise = \"{}\"\ndomain = {}\nprofile = \"{}\"\nsocket = \"dds.sock\"\n",
        supervise, domain_.text(), ABBE_LOOPBACK_PROFILE);
    std::ofstream(config) << text;
  }
  std::string socket = directory_ / "dds.sock";
  std::string config = directory_ / "abbed.toml";
};

TEST_F(AbbeDds, MissingProfileEndsWithThree) {
  EXPECT_EQ(exit_code({"--socket", socket, "--profile", directory_ / "missing.xml"}), 3);
}

TEST_F(AbbeDds, ProfileThatIsNoProfileEndsWithThree) {
  std::ofstream(directory_ / "bad.xml") << "<nonsense/>";
  EXPECT_EQ(exit_code({"--socket", socket, "--profile", directory_ / "bad.xml"}), 3);
}

TEST_F(AbbeDds, DomainWithoutPortsEndsWithTwo) {
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", "233"}), 2);
}

// Fast DDS would make a participant that no other receives, also after the network has come up.
TEST_F(AbbeDds, WithoutAnInterfaceOfItsProfileItEndsWithFour) {
  std::stringstream text;
  text << std::ifstream(ABBE_LOOPBACK_PROFILE).rdbuf();
  std::string profile = text.str();
  const std::string named = "<interfaceWhiteList><address>127.0.0.1<";
  ASSERT_NE(profile.find(named), std::string::npos);
  profile.replace(profile.find(named), named.size(), "<interfaceWhiteList><address>203.0.113.1<");
  std::ofstream(directory_ / "absent.xml") << profile;
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", domain_.text(), "--profile",
                       directory_ / "absent.xml", "--parent", "1"}),
            4);
}

TEST_F(AbbeDds, AsAServiceItRefusesAConfigurationThatMakesItAChild) {
  write_config("child");
  EXPECT_EQ(exit_code({"--config", config}), 5);
}

TEST_F(AbbeDds, AsAServiceItFindsSocketDomainAndProfileInTheConfiguration) {
  write_config("systemd");
  auto link = daemon::DdsLink::listen(socket);
  ASSERT_TRUE(link) << link.error().text;
  const Process service({ABBE_DDS_PROGRAM, "--config", config});
  const auto deadline = Clock::now() + std::chrono::seconds{20};
  while (!link->connected() && Clock::now() < deadline) {
    link->poll();
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  EXPECT_TRUE(link->connected());
}

TEST_F(AbbeDds, WithoutSocketAndConfigurationItIsUsage) {
  EXPECT_EQ(exit_code({}), 2);
}

TEST_F(AbbeDds, EndsWhenItsParentIsAnotherProcess) {
  EXPECT_EQ(exit_code({"--socket", socket, "--domain", domain_.text(), "--profile",
                       ABBE_LOOPBACK_PROFILE, "--parent", "1"}),
            0);
}

TEST_F(AbbeDds, HelpListsTheExitCodes) {
  Process help({ABBE_DDS_PROGRAM, "--help"});
  EXPECT_EQ(help.wait_for_end(), 0);
  EXPECT_NE(help.transcript().find("Exit codes: 0 stopped"), std::string::npos);
}

TEST_F(AbbeDds, WatchTakesItsDomainFromTheConfigurationAndReportsSilence) {
  write_config("systemd");
  Process watch({"/bin/sh", "-c", "exec \"$@\" 2>&1", "sh", ABBE_WATCH_PROGRAM, "-c", config,
                 "--timeout-s", "6"});
  EXPECT_EQ(watch.wait_for_end(), 0);
  EXPECT_NE(
      watch.transcript().find("nothing received for 5 s in DDS domain " + domain_.text() +
                              "; waiting for the topics abbe/v1/Identity, abbe/v1/ModelState"),
      std::string::npos)
      << watch.transcript();
}

/// What a process reports to the service manager.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& path) {
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    path.copy(at.sun_path, sizeof at.sun_path - 1);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
    ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
    ::setenv("WATCHDOG_USEC", "200000", 1);
  }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;
  ~NotifySocket() {
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    ::close(fd_);
  }
  /// The next message; empty: none within `at_most`.
  [[nodiscard]] std::string next(std::chrono::milliseconds at_most = std::chrono::seconds{
                                     20}) const {
    pollfd ready{fd_, POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(at_most.count())) <= 0) return {};
    std::array<char, 256> text{};
    const auto n = ::recv(fd_, text.data(), text.size(), 0);
    return {text.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0))};
  }

 private:
  int fd_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
};

TEST_F(AbbeDds, AsAServiceItFeedsTheWatchdogOnlyWhileItsLoopRuns) {
  write_config("systemd");
  const NotifySocket manager(directory_ / "notify");
  const Process service({ABBE_DDS_PROGRAM, "--config", config});
  EXPECT_TRUE(manager.next().starts_with("READY=1"));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(manager.next(), "WATCHDOG=1");
  service.signal(SIGSTOP);
  while (!manager.next(std::chrono::milliseconds{500}).empty()) {
  }
  EXPECT_EQ(manager.next(std::chrono::seconds{1}), "");
  service.signal(SIGCONT);
  EXPECT_EQ(manager.next(), "WATCHDOG=1");
}

/// The notification socket it has inherited is abbed's.
TEST_F(AbbeDds, AsAChildItSendsNothingToTheServiceManager) {
  auto link = daemon::DdsLink::listen(socket);
  ASSERT_TRUE(link) << link.error().text;
  const NotifySocket manager(directory_ / "notify");
  const Process child({ABBE_DDS_PROGRAM, "--socket", socket, "--domain", domain_.text(),
                       "--profile", ABBE_LOOPBACK_PROFILE, "--parent", std::to_string(::getpid())});
  const auto deadline = Clock::now() + std::chrono::seconds{20};
  while (!link->connected() && Clock::now() < deadline) {
    link->poll();
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  }
  ASSERT_TRUE(link->connected());
  EXPECT_EQ(manager.next(std::chrono::milliseconds{500}), "");
}

}  // namespace
}  // namespace abbe::test
