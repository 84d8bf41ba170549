#pragma once
/// Several simulated Modbus slaves on one pseudo terminal, or behind one gateway's port: the same
/// registers in each; every one may be mute or late. A gateway and a line carry one request at a
/// time.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>

#include "abbe/protocol/time.hpp"
#include "modbus_peer.hpp"

namespace abbe::tests {

class ModbusBusPeer {
 public:
  struct Slave {
    bool mute = false;
    std::chrono::nanoseconds late{};
  };

  explicit ModbusBusPeer(modbus::Transport transport) : wire_(transport) {
    wire_.proving_from = 0xFFFF;
  }

  [[nodiscard]] drivers::ModbusAddress address() const { return wire_.address(); }
  [[nodiscard]] std::size_t connections() const { return wire_.connections; }
  void unplug() {
    wire_.unplug();
    answer_.reset();
  }
  void plug_in() { wire_.plug_in(); }

  void serve(protocol::HostTime now) {
    wire_.serve();
    if (wire_.asked()) {
      if (answer_) ++collisions;
      const auto slave = slaves.find(wire_.asked()->unit);
      const auto bytes = wire_.take_answer();
      answer_.reset();
      if (slave != slaves.end() && !slave->second.mute)
        answer_.emplace(now + slave->second.late, bytes);
    }
    if (!answer_ || now < answer_->first) return;
    wire_.send(answer_->second);
    answer_.reset();
  }

  std::map<std::uint8_t, Slave> slaves;
  std::size_t collisions = 0;  ///< requests while another one was not answered yet

 private:
  ModbusPeer wire_;
  std::optional<std::pair<protocol::HostTime, ModbusBytes>> answer_;
};

}  // namespace abbe::tests
