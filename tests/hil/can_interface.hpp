#pragma once
/// What the tests do to a CAN interface from outside the driver: make it, take it down, put
/// unrequested frames on it. Needs root, as in the guest.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/linux_frame.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "stamped_socket.hpp"

namespace abbe::tests {

namespace can = protocol::can;

inline bool run(const std::string& command) {
  return std::system(command.c_str()) == 0;
}

/// An interface that is up; taken down or away by the test.
class CanInterface {
 public:
  explicit CanInterface(std::string name) : name_(std::move(name)) {}
  [[nodiscard]] const std::string& name() const { return name_; }
  void up() const { change(IFF_UP, 0); }
  void down() const { change(0, IFF_UP); }

 private:
  /// By hand: starting a program would cost seconds of virtual time.
  void change(int set, int clear) const {
    const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ifreq request{};
    name_.copy(request.ifr_name, IFNAMSIZ - 1);
    EXPECT_EQ(::ioctl(fd, SIOCGIFFLAGS, &request), 0) << name_;
    request.ifr_flags = static_cast<short>((request.ifr_flags | set) & ~clear);
    EXPECT_EQ(::ioctl(fd, SIOCSIFFLAGS, &request), 0) << name_;
    ::close(fd);
  }

  std::string name_;
};

/// A virtual bus of its own, removed after the test.
class VirtualCan : public CanInterface {
 public:
  explicit VirtualCan(int mtu = CANFD_MTU, const std::string& name = "vcan7") : CanInterface(name) {
    EXPECT_TRUE(
        run(fmt::format("ip link add {0} type vcan && ip link set {0} mtu {1} up", name, mtu)));
  }
  VirtualCan(const VirtualCan&) = delete;
  VirtualCan& operator=(const VirtualCan&) = delete;
  ~VirtualCan() { remove(); }
  void remove() {
    if (std::exchange(gone_, true)) return;
    EXPECT_TRUE(run("ip link del " + name()));
  }

 private:
  bool gone_ = false;
};

/// A plain socket on the bus, as any other program has one.
class CanSocket {
 public:
  explicit CanSocket(const CanInterface& interface)
      : fd_(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW)) {
    const int on = 1;
    ::setsockopt(fd_, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(if_nametoindex(interface.name().c_str()));
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0)
        << interface.name();
  }
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;
  ~CanSocket() { ::close(fd_); }

  /// False: the kernel took less than all of it (queue full, interface down).
  bool send(std::span<const can::CanFrame> frames) const {
    for (const auto& frame : frames) {
      const auto out = drivers::to_linux(frame);
      if (::write(fd_, &out.frame, out.size) != static_cast<ssize_t>(out.size)) return false;
    }
    return true;
  }
  bool send(const can::CanFrame& frame) const { return send({&frame, 1}); }
  /// As a controller would report it; vcan passes on what is written to it.
  bool send_condition(can::BusCondition condition) const {
    return send(
        can::encode_error_frame({.conditions = static_cast<can::BusConditions>(condition)}));
  }
  [[nodiscard]] std::optional<can::CanFrame> receive(std::chrono::milliseconds at_most = {}) const {
    pollfd ready{fd_, POLLIN, 0};
    ::poll(&ready, 1, static_cast<int>(at_most.count()));
    canfd_frame frame{};
    const auto size = ::read(fd_, &frame, sizeof frame);
    if (size < 0) return std::nullopt;
    return drivers::from_linux(frame, static_cast<std::size_t>(size));
  }

 private:
  int fd_;
};

/// Until the kernel stamps what comes: its worker switches that on some time after it was asked
/// for.
template <class Bus>
void wait_for_stamps(Bus& bus, const CanSocket& other, const can::CanFrame& frame) {
  std::array<drivers::ReceivedFrame, 4> some{};
  for (int i = 0; i < 100; ++i, ::usleep(10'000)) {
    const auto widened = bus.counters().time_widened;
    ASSERT_TRUE(other.send(frame));
    ASSERT_TRUE(bus.read(some, std::chrono::seconds{1}).has_value());
    if (bus.counters().time_widened == widened) return;
  }
  FAIL() << "the kernel stamps nothing";
}

}  // namespace abbe::tests
