#pragma once
/// [[environment]]: Modbus devices that measure air, or temperatures of scales and parts. Pure
/// data.

#include <chrono>
#include <string>

#include "abbe/drivers/environment/modbus_line.hpp"
#include "abbe/drivers/environment/register_map.hpp"

namespace abbe::daemon {

struct ConfigKind;

struct EnvironmentConfig {
  static const ConfigKind kKind;
  std::string name;
  drivers::ModbusAddress address;
  drivers::RegisterMap map;
  std::chrono::nanoseconds period{std::chrono::seconds{1}};
  std::chrono::nanoseconds answer_timeout{std::chrono::milliseconds{500}};
};

}  // namespace abbe::daemon
