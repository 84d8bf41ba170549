#pragma once
/// Connection and wiring of one USB-QUAD08 counter card. Pure data.

#include <chrono>
#include <cstdint>
#include <string>

#include "abbe/drivers/counter_card/wiring.hpp"

namespace abbe::daemon {

enum class CardTransport { Usb, Usbip };

struct UsbCardConfig {
  std::string name;
  CardTransport transport = CardTransport::Usb;
  std::string host = "127.0.0.1";  ///< USB/IP only
  std::uint16_t port = 3240;       ///< USB/IP only
  std::string bus_id = "1-1";      ///< USB/IP only
  std::string serial_number;       ///< empty: the only connected card
  drivers::CounterCardWiring wiring;
  /// Upper bound of the constant part of the delay between a scan and its arrival. This part cannot
  /// be estimated from arrival times.
  std::chrono::nanoseconds max_constant_delay{std::chrono::milliseconds{1}};
};

}  // namespace abbe::daemon
