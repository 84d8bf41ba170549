#include "read_environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

namespace abbe::sim {
namespace {

/// Reads the keys of one quantity: its mean from NAME_UNIT; NAME_drift_per_hour, NAME_swing and
/// NAME_swing_period_s.
void read_course(TomlSection& section, std::string_view name, std::string_view unit,
                 Course& course) {
  section.number(fmt::format("{}_{}", name, unit), course.mean);
  section.number(fmt::format("{}_drift_per_hour", name), course.drift_per_hour);
  section.number(fmt::format("{}_swing", name), course.swing);
  section.number(fmt::format("{}_swing_period_s", name), course.swing_period_s, 1.0,
                 kPositiveNumber);
}

void read_model(TomlSection& section, EnvironmentModel& model) {
  read_course(section, "air_temperature", "C", model.air_temperature_C);
  read_course(section, "air_pressure", "hPa", model.air_pressure_hPa);
  read_course(section, "humidity", "percent", model.relative_humidity_percent);
  for (std::size_t i = 0; i < kSimulatedInputs; ++i)
    read_course(section, fmt::format("input{}", i), "C", model.temperature_C[i]);
}

void read_endpoint(TomlSection& section, ModbusServerOptions& options) {
  std::uint16_t port = 0;
  std::string link;
  const bool on_terminal = section.text("link", link);
  if (section.port("port", port) && on_terminal) section.fault("port", "has no meaning with link");
  if (on_terminal) {
    options.endpoint = ModbusPtyEndpoint{link};
  } else {
    options.endpoint = ModbusTcpEndpoint{port};
  }
}

ModbusServerOptions read_device(TomlSection& section) {
  ModbusServerOptions options;
  if (!section.text("name", options.name)) section.fault("name", "missing");
  std::string model;
  section.text("model", model);

  if (const auto known = modbus_model(model)) {
    options.identity.model = *known;
  } else {
    section.fault("model", "must be \"indigo520_hmp\", \"comet_t7510\" or \"zt2005_c8\"");
  }

  std::int64_t serial_number = options.identity.serial_number;
  std::int64_t unit = options.identity.unit;
  if (section.integer("serial_number", serial_number, 0, 99'999'999))
    options.identity.serial_number = static_cast<std::uint32_t>(serial_number);
  if (section.integer("unit", unit, 1, 247))
    options.identity.unit = static_cast<std::uint8_t>(unit);
  read_endpoint(section, options);
  read_model(section, options.environment);
  section.refuse_unknown_keys();

  return options;
}

}  // namespace

void read_environment(TomlSection& sim, std::vector<ModbusServerOptions>& devices) {
  for (TomlSection& section : sim.children("environment")) {
    auto device = read_device(section);
    const auto same = [&](const ModbusServerOptions& d) { return d.name == device.name; };
    if (std::any_of(devices.begin(), devices.end(), same)) section.fault("name", "is used twice");
    devices.push_back(std::move(device));
  }
}

}  // namespace abbe::sim
