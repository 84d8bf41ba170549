#pragma once
/// A Modbus device in the test's own thread, on a listening socket of 127.0.0.1 or on a pseudo
/// terminal, with its answers under the test's control: identification registers are answered at
/// once, measured ones when the test requests it. Nothing happens but in the functions a test
/// calls.

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/drivers/environment/device.hpp"
#include "abbe/sim/socket.hpp"
#include "modbus_script.hpp"
#include "peer_socket.hpp"

namespace abbe::tests {

/// Owns port or terminal; the address stays the same through unplug() and plug_in().
class ModbusPeer {
 public:
  explicit ModbusPeer(modbus::Transport transport) : transport_(transport) {
    if (transport == modbus::Transport::Tcp) {
      holder_ = bound_socket(0);
      port_ = sim::port_of(holder_);
    } else {
      std::string folder = (std::filesystem::temp_directory_path() / "abbe-modbus-XXXXXX").string();
      EXPECT_NE(mkdtemp(folder.data()), nullptr);
      folder_ = folder;
    }
    plug_in();
  }
  ~ModbusPeer() {
    unplug();
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
  }
  ModbusPeer(const ModbusPeer&) = delete;
  ModbusPeer& operator=(const ModbusPeer&) = delete;

  [[nodiscard]] drivers::ModbusAddress address() const {
    if (transport_ == modbus::Transport::Tcp) return drivers::ModbusTcp{"127.0.0.1", port_};
    return drivers::ModbusSerial{.path = link()};
  }
  std::map<std::uint16_t, std::uint16_t> registers = small_registers();
  std::uint16_t proving_from = 100;  ///< registers from here on are answered at once

  /// Accepts a client and reads its requests.
  void serve() {
    if (listener_) {
      sim::Socket accepted(
          ::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
      if (accepted) {
        wire_ = std::move(accepted);
        ++connections;
        asked_.reset();
        const int yes =
            // else bytes after an answer wait for a delayed ACK, in a time the test does not have
            1;
        ::setsockopt(wire_.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
      }
    }

    std::array<std::byte, 256> bytes{};
    const auto n = wire_ ? ::read(wire_.get(), bytes.data(), bytes.size()) : 0;
    if (n <= 0) return;
    const auto request =
        modbus::decode_request(std::span{bytes}.first(static_cast<std::size_t>(n)), transport_);

    ASSERT_TRUE(request) << modbus::name_of(request.error());
    ++requests;
    asked_ = *request;
    if (request->address >= proving_from) answer();
  }
  [[nodiscard]] const std::optional<modbus::ReadRequest>& asked() const { return asked_; }
  [[nodiscard]] ModbusBytes take_answer() {
    const auto request = std::exchange(asked_, std::nullopt);
    return request ? modbus_answer(transport_, *request, registers) : ModbusBytes{};
  }
  void answer() { send(take_answer()); }
  void decline(std::uint8_t code) {
    if (const auto request = std::exchange(asked_, std::nullopt))
      send(modbus_exception(transport_, *request, code));
  }
  void send(std::span<const std::byte> bytes) {
    if (wire_ && !bytes.empty()) (void)!::write(wire_.get(), bytes.data(), bytes.size());
  }
  void send(std::string_view text) { send(std::as_bytes(std::span{text})); }

  void unplug() {
    wire_.close();
    client_end_.close();
    listener_.close();
    asked_.reset();
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove(link(), ignored);
  }
  void plug_in() {
    if (transport_ == modbus::Transport::Tcp) {
      listener_ = bound_socket(port_);
      ASSERT_EQ(::listen(listener_.get(), 4), 0);
      return;
    }

    wire_ = sim::Socket(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    ASSERT_TRUE(wire_);
    ASSERT_EQ(grantpt(wire_.get()), 0);
    ASSERT_EQ(unlockpt(wire_.get()), 0);
    std::array<char, 64> path{};

    ASSERT_EQ(ptsname_r(wire_.get(), path.data(), path.size()), 0);
    client_end_ = sim::Socket(::open(path.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    termios raw{};
    ASSERT_EQ(tcgetattr(client_end_.get(), &raw), 0);
    cfmakeraw(&raw);
    tcsetattr(client_end_.get(), TCSANOW, &raw);
    std::filesystem::create_symlink(path.data(), link());
  }
  /// Only the TCP connection is lost; on a terminal the adapter goes and comes back.
  void hang_up() {
    if (transport_ == modbus::Transport::Tcp) {
      wire_.close();
      asked_.reset();
    } else {
      unplug();
      plug_in();
    }
  }

  std::size_t requests = 0;
  std::size_t connections = 0;  ///< over TCP

 private:
  [[nodiscard]] std::string link() const { return folder_ + "/line"; }
  modbus::Transport transport_;
  std::string folder_;
  std::uint16_t port_ = 0;
  sim::Socket holder_;
  sim::Socket listener_;
  sim::Socket wire_;
  sim::Socket client_end_;
  std::optional<modbus::ReadRequest> asked_;
};

}  // namespace abbe::tests
