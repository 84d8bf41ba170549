/// DATA_DIR/machine-hold as a start finds it: what it cannot read it must not take for "nothing is
/// held".

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <string>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/devices/device_set.hpp"
#include "config_tables.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class MachineHold : public ::testing::Test {
 protected:
  MachineHold() {
    // No server listens at port 1: only the file shows whether a release is awaited.
    auto config = parse_config(
        to_toml(config_tables::half_metre_mill()) + "[cmm]\nhost = \"127.0.0.1\"\nport = 1\n",
        "abbed.toml");
    EXPECT_TRUE(config) << config.error().details.front();
    config_ = *config;
    config_.daemon.data_dir = folder_.path();
  }
  [[nodiscard]] fs::path file() const { return folder_.path() / "machine-hold"; }
  /// Why a start awaits a release; empty: it does not.
  [[nodiscard]] std::string awaited() const {
    const auto devices = DeviceSet::start(config_, time_);
    EXPECT_TRUE(devices) << devices.error().text;
    return devices ? devices->release_awaited().value_or("") : "no devices";
  }

  TemporaryFolder folder_;
  drivers::MonotonicTime time_;
  Config config_;
};

TEST_F(MachineHold, WithoutAFileNothingIsHeld) {
  EXPECT_EQ(awaited(), "");
}

TEST_F(MachineHold, KeepsTheReason) {
  test::write_text(file(), "emergency stop (error 0512)");
  EXPECT_THAT(awaited(), AllOf(HasSubstr("since before the restart"),
                               HasSubstr("emergency stop (error 0512)")));
}

TEST_F(MachineHold, AFileThatCannotBeReadHoldsTheMachine) {
  test::write_text(file(), "emergency stop");
  ASSERT_EQ(::chmod(file().c_str(), 0), 0);
  if (::geteuid() ==
      0) {  // root may read it all the same: a link to itself cannot be read by anybody
    fs::remove(file());
    fs::create_symlink(file(), file());
  }
  EXPECT_THAT(awaited(), AllOf(HasSubstr("unknown reason"), HasSubstr("cannot be read")));
}

TEST_F(MachineHold, ADirectoryInItsPlaceHoldsTheMachine) {
  fs::create_directory(file());
  EXPECT_THAT(awaited(), AllOf(HasSubstr("unknown reason"), HasSubstr("cannot be read")));
}

TEST_F(MachineHold, APipeInItsPlaceHoldsTheMachineAndDoesNotBlockTheStart) {
  ASSERT_EQ(::mkfifo(file().c_str(), 0600), 0);
  EXPECT_THAT(awaited(), AllOf(HasSubstr("unknown reason"), HasSubstr("is not a regular file")));
}

// The earlier format has no line for a running motion: only the reason, or an empty file.
TEST_F(MachineHold, TheOldFormatHoldsTheMachine) {
  test::write_text(file(), "since before the restart: AbortE was refused");
  EXPECT_EQ(awaited(), "cmm 127.0.0.1:1: since before the restart: AbortE was refused");
  test::write_text(file(), "");
  EXPECT_THAT(awaited(), HasSubstr("unknown reason"));
}

/// A computer that does not answer: each attempt to connect blocks until its time-out.
class SilentPeer {
 public:
  SilentPeer() {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof at;
    auto* const address = reinterpret_cast<sockaddr*>(&at);
    EXPECT_EQ(::bind(sockets_[0], address, length), 0);
    EXPECT_EQ(::listen(sockets_[0], 0), 0);
    EXPECT_EQ(::getsockname(sockets_[0], address, &length), 0);
    for (std::size_t i = 1; i < sockets_.size(); ++i) (void)::connect(sockets_[i], address, length);
    port_ = ::ntohs(at.sin_port);
  }
  SilentPeer(const SilentPeer&) = delete;
  SilentPeer& operator=(const SilentPeer&) = delete;
  ~SilentPeer() {
    for (const int socket : sockets_) ::close(socket);
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  static int make() { return ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0); }
  std::array<int, 4> sockets_{make(), make(), make(),
                              make()};  ///< the listener and who fills its queue
  std::uint16_t port_ = 0;
};

TEST_F(MachineHold, IsReportedAndReleasedWhileTheServerIsUnreachable) {
  const SilentPeer peer;
  config_.of<CmmConfig>()->port = peer.port();
  test::write_text(file(), "a motion is under way\n");
  auto devices = DeviceSet::start(config_, time_);

  ASSERT_TRUE(devices) << devices.error().text;
  const auto state = [&] { return devices->health(time_.now()).front().status.state; };
  for (int i = 0; i < 1000 && state() != "connecting"; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  ASSERT_EQ(state(), "connecting");
  EXPECT_THAT(devices->release_awaited().value_or(""),
              HasSubstr("ended while the machine was moving"));
  const auto released = devices->release_machine();
  EXPECT_TRUE(released) << released.error().text;
  for (int i = 0; i < 1000 && devices->release_awaited(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
  EXPECT_FALSE(devices->release_awaited());
  const auto again = devices->release_machine();
  ASSERT_FALSE(again);
  EXPECT_THAT(again.error().text, HasSubstr("awaits no release"));
}

TEST_F(MachineHold, AMotionUnderWayHoldsTheMachine) {
  test::write_text(file(), "a motion is under way\n");
  EXPECT_THAT(awaited(), HasSubstr("ended while the machine was moving"));
}

}  // namespace
}  // namespace abbe::daemon
