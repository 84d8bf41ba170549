#include "abbe/drivers/emergency_stop.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <future>
#include <string>
#include <thread>

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::EmergencyStop;
using drivers::send_emergency_stops;

/// Both ends of a connection to a machine.
struct Wire {
  Wire() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0); }
  ~Wire() {
    for (const int end : ends) ::close(end);
  }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;
  [[nodiscard]] std::string heard() const {
    std::array<char, 256> bytes{};
    const ssize_t n = ::recv(ends[1], bytes.data(), bytes.size(), MSG_DONTWAIT);
    return {bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0))};
  }
  void answer(const std::string& text) const {
    ASSERT_EQ(::send(ends[1], text.data(), text.size(), 0), static_cast<ssize_t>(text.size()));
  }
  std::array<int, 2> ends{};
};

TEST(EmergencyStop, IsSentToAMachineThatMovesAndWaitsForItsConfirmation) {
  const Wire wire;
  EmergencyStop stop{"STOP\r\n", "STOP done"};
  stop.set_socket(wire.ends[0]);
  stop.set_moving(true);
  wire.answer(std::string(700, '.') + "STOP ");  // longer than one read; cut in the confirmation
  wire.answer("done\r\n");
  const auto done = send_emergency_stops(10s);
  EXPECT_EQ(wire.heard(), "STOP\r\n");
  EXPECT_EQ(done.sent, 1);
  EXPECT_EQ(done.confirmed, 1);
  EXPECT_EQ(done.not_sent, 0);
}

TEST(EmergencyStop, IsNotSentToAMachineThatStands) {
  const Wire wire;
  EmergencyStop stop{"STOP\r\n", "done"};
  stop.set_socket(wire.ends[0]);
  EXPECT_EQ(send_emergency_stops(0ms).sent, 0);
  EXPECT_EQ(wire.heard(), "");
}

TEST(EmergencyStop, WithoutAConnectionCountsAsNotSent) {
  const Wire wire;
  EmergencyStop unplugged{"STOP\r\n", "done"}, connected{"HALT\r\n", "done"};
  unplugged.set_moving(true);
  connected.set_moving(true);
  connected.set_socket(wire.ends[0]);
  const auto done = send_emergency_stops(1ms);
  EXPECT_EQ(done.sent, 1) << "one machine does not keep the other from being stopped";
  EXPECT_EQ(done.not_sent, 1);
  EXPECT_EQ(done.confirmed, 0) << "no answer";
  EXPECT_EQ(wire.heard(), "HALT\r\n");
}

TEST(EmergencyStop, DoesNotWaitForSpaceInASocket) {
  const Wire wire;
  const std::string much(1 << 20, 'x');
  while (::send(wire.ends[0], much.data(), much.size(), MSG_DONTWAIT) > 0) {
  }
  EmergencyStop stop{"STOP\r\n", "done"};
  stop.set_socket(wire.ends[0]);
  stop.set_moving(true);
  EXPECT_EQ(send_emergency_stops(0ms).not_sent, 1);
}

TEST(EmergencyStop, KeepsTheSocketFromBeingClosedWhileItIsUsed) {
  const Wire wire;
  EmergencyStop stop{"STOP\r\n", "done"};
  stop.set_socket(wire.ends[0]);
  stop.set_moving(true);
  auto sender = std::async(std::launch::async, [] { return send_emergency_stops(10s); });
  while (wire.heard().empty()) std::this_thread::yield();
  auto closing = std::async(std::launch::async, [&stop] { stop.set_socket(-1); });
  EXPECT_EQ(closing.wait_for(20ms), std::future_status::timeout);
  wire.answer("done\r\n");
  closing.get();
  EXPECT_EQ(sender.get().confirmed, 1);
}

TEST(EmergencyStop, ForgetsAConnectionThatIsDestroyed) {
  for (int i = 0; i < 100; ++i) {  // more than there are places
    EmergencyStop stop{"STOP\r\n", "done"};
    stop.set_moving(true);
    EXPECT_EQ(send_emergency_stops(0ms).not_sent, 1);
  }
  EXPECT_EQ(send_emergency_stops(0ms).not_sent, 0);
}

}  // namespace
}  // namespace abbe::tests
