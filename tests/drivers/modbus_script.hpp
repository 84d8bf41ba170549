#pragma once
/// What a Modbus device sends, as bytes, and a small register map with registers to match.

#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "abbe/drivers/environment/register_map.hpp"
#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/modbus/read.hpp"

namespace abbe::tests {

namespace modbus = protocol::modbus;
using ModbusBytes = std::vector<std::byte>;

/// The frame around an answer: unit, function, then `rest`.
inline ModbusBytes modbus_frame(modbus::Transport transport, const modbus::ReadRequest& to,
                                std::span<const std::byte> rest, bool exception = false) {
  ModbusBytes bytes(300);
  protocol::ByteWriter writer{bytes};
  if (transport == modbus::Transport::Tcp) {
    writer.zeros(4);
    writer.big(static_cast<std::uint16_t>(2 + rest.size()));
  }

  writer.big(to.unit);
  writer.big(
      static_cast<std::uint8_t>(static_cast<std::uint8_t>(to.function) | (exception ? 0x80u : 0u)));
  writer.put(rest);
  if (transport == modbus::Transport::Rtu) writer.little(modbus::crc16(writer.written()));
  bytes.resize(writer.size());

  return bytes;
}

/// Registers by address, those that are not named are 0.
inline ModbusBytes modbus_answer(modbus::Transport transport, const modbus::ReadRequest& to,
                                 const std::map<std::uint16_t, std::uint16_t>& registers) {
  ModbusBytes rest(1 + 2u * to.count);
  protocol::ByteWriter writer{rest};
  writer.big(static_cast<std::uint8_t>(2 * to.count));
  for (unsigned i = 0; i < to.count; ++i) {
    const auto found = registers.find(static_cast<std::uint16_t>(to.address + i));
    writer.big(found == registers.end() ? std::uint16_t{0} : found->second);
  }
  return modbus_frame(transport, to, rest);
}
inline ModbusBytes modbus_exception(modbus::Transport transport, const modbus::ReadRequest& to,
                                    std::uint8_t code) {
  const std::array rest{static_cast<std::byte>(code)};
  return modbus_frame(transport, to, rest, true);
}

/// Air temperature at 10 and pressure at 11 in tenths, temperature 3 at 30; serial number in BCD at
/// 100.
inline drivers::RegisterMap small_map(std::uint8_t unit = 7) {
  using drivers::Quantity;
  const auto at = [unit](std::uint16_t address,
                         modbus::RegisterType type = modbus::RegisterType::Int16) {
    return drivers::RegisterPlace{unit, modbus::Function::ReadHoldingRegisters, address, type,
                                  modbus::WordOrder::HighFirst};
  };

  drivers::RegisterMap map;
  map.name = "small";
  map.measured = {{"air temperature", Quantity::AirTemperature, 0, at(10), 0.1, 273.15, {}},
                  {"air pressure", Quantity::AirPressure, 0, at(11), 10.0, 0.0, {}},
                  {"part", Quantity::Temperature, 3, at(30), 0.1, 273.15, {-32768.0}}};
  map.proving = {{"serial number", at(100, modbus::RegisterType::Bcd32), 12345678.0}};

  return map;
}
inline std::map<std::uint16_t, std::uint16_t> small_registers() {
  return {{10, 215}, {11, 10131}, {30, 204}, {100, 0x1234}, {101, 0x5678}};
}

}  // namespace abbe::tests
