#include "read_environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

namespace abbe::sim {
namespace {

/// Reads the keys of one quantity: its mean from NAME_UNIT; NAME_drift_per_hour, NAME_swing and
/// NAME_swing_period_s.
void read_course(Section& section, std::string_view name, std::string_view unit, Course& course) {
  section.get(fmt::format("{}_{}", name, unit), course.mean, kPlain, kAnyNumber);
  section.get(fmt::format("{}_drift_per_hour", name), course.drift_per_hour, kPlain, kAnyNumber);
  section.get(fmt::format("{}_swing", name), course.swing, kPlain, kAnyNumber);
  section.get(fmt::format("{}_swing_period_s", name), course.swing_period_s, kPlain,
              kPositiveNumber);
}

void read_model(Section& section, EnvironmentModel& model) {
  read_course(section, "air_temperature", "C", model.air_temperature_C);
  read_course(section, "air_pressure", "hPa", model.air_pressure_hPa);
  read_course(section, "humidity", "percent", model.relative_humidity_percent);
  for (std::size_t i = 0; i < kSimulatedInputs; ++i)
    read_course(section, fmt::format("input{}", i), "C", model.temperature_C[i]);
}

void read_endpoint(Section& section, ModbusServerOptions& options) {
  std::uint16_t port = 0;
  std::string link;
  const bool on_terminal = section.get("link", link);
  if (get_port(section, "port", port) && on_terminal)
    section.fault("port", "has no meaning with link");
  if (on_terminal) {
    options.endpoint = ModbusPtyEndpoint{link};
  } else {
    options.endpoint = ModbusTcpEndpoint{port};
  }
}

ModbusServerOptions read_device(Section& section) {
  ModbusServerOptions options;
  section.get("name", options.name, Need::Required);
  std::string model;
  section.get("model", model);

  if (const auto known = modbus_model(model)) {
    options.identity.model = *known;
  } else {
    section.fault("model", "must be \"indigo520_hmp\", \"comet_t7510\" or \"zt2005_c8\"");
  }

  section.get_integer("serial_number", options.identity.serial_number, 0, 99'999'999);
  section.get_integer("unit", options.identity.unit, 1, 247);
  read_endpoint(section, options);
  read_model(section, options.environment);
  section.close(Hint::AllKeys);

  return options;
}

}  // namespace

void read_environment(Section& sim, std::vector<ModbusServerOptions>& devices) {
  for (Section& section : sim.children("environment")) {
    auto device = read_device(section);
    const auto same = [&](const ModbusServerOptions& d) { return d.name == device.name; };
    if (std::any_of(devices.begin(), devices.end(), same)) section.fault("name", "is used twice");
    devices.push_back(std::move(device));
  }
}

}  // namespace abbe::sim
