#include "abbe/sim/modbus_registers.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace abbe::sim {
namespace {

using Registers = std::vector<SimulatedRegister>;
using std::chrono::nanoseconds;

/// Vaisala: least significant word first, so 30.56 %RH = 41F47AE1h is stored as 7AE1h 41F4h.
void put_vaisala_float(Registers& to, std::uint8_t unit, std::uint16_t address, double value) {
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
  to.push_back({unit, RegisterSpace::Holding, address, static_cast<std::uint16_t>(bits & 0xFFFFu)});
  to.push_back({unit, RegisterSpace::Holding, static_cast<std::uint16_t>(address + 1),
                static_cast<std::uint16_t>(bits >> 16)});
}

std::uint16_t tenths(double value) {
  return static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(10.0 * value)));
}

/// Magnus formula; its accuracy is sufficient for a simulated display.
double dew_point_C(double t_C, double rh_percent) {
  const double g = std::log(std::max(rh_percent, 0.1) / 100.0) + 17.62 * t_C / (243.12 + t_C);
  return 243.12 * g / (17.62 - g);
}

struct Air {
  double t_C, p_hPa, rh_percent;
};

Registers indigo(const Air& air, bool sensors_gone) {
  constexpr double kGone = std::numeric_limits<double>::quiet_NaN();
  Registers r;
  put_vaisala_float(r, 241, 0x0000, sensors_gone ? kGone : air.rh_percent);
  put_vaisala_float(r, 241, 0x0002, sensors_gone ? kGone : air.t_C);
  put_vaisala_float(r, 241, 0x0006, sensors_gone ? kGone : dew_point_C(air.t_C, air.rh_percent));
  put_vaisala_float(r, 240, 0x002A, air.p_hPa);
  r.push_back({241, RegisterSpace::Holding, 0x0200, 1});  // no errors
  r.push_back({241, RegisterSpace::Holding, 0x0203, 0});  // error code, low word
  r.push_back({241, RegisterSpace::Holding, 0x0204, 0});
  return r;
}

std::uint16_t bcd(std::uint32_t four_digits) {
  std::uint32_t out = 0;
  for (unsigned shift = 0; shift < 16; shift += 4, four_digits /= 10)
    out |= (four_digits % 10) << shift;
  return static_cast<std::uint16_t>(out);
}

Registers comet(const Air& air, std::uint32_t serial) {
  Registers r;
  const auto put = [&r](std::uint16_t address, std::uint16_t value) {
    r.push_back({0, RegisterSpace::Holding, address, value});
  };
  put(49, tenths(air.t_C));
  put(50, tenths(air.rh_percent));
  put(52, tenths(air.p_hPa));
  put(53, tenths(dew_point_C(air.t_C, air.rh_percent)));
  put(4149, bcd(serial / 10'000));
  put(4150, bcd(serial % 10'000));
  return r;
}

bool is_broken(const BrokenInput& broken, std::size_t input) {
  return broken.input == 0 || broken.input == input + 1;
}

/// The reading of an input with a fault; `right_C` is the reading without the fault.
double broken_reading_C(const BrokenInput& fault, const EnvironmentModel& environment,
                        std::size_t input, nanoseconds t, double right_C) {
  constexpr std::int64_t kSpikePeriod_s = 5;
  const auto& sensors = environment.temperature_C;
  switch (fault.kind) {
    case FaultKind::SensorValue:
      return fault.value;
    case FaultKind::SensorStuck:
      return sensors[input].at(fault.since);
    case FaultKind::SensorSwapped:
      return sensors[input ^ 1u].at(t);
    case FaultKind::SensorFahrenheit:
      return 1.8 * right_C + 32.0;
    case FaultKind::SensorSpikes:
      return std::chrono::duration_cast<std::chrono::seconds>(t).count() % kSpikePeriod_s == 0
                 ? right_C + fault.value
                 : right_C;
    case FaultKind::SensorDrift:
      return right_C + fault.value * ns_to_seconds(t - fault.since) / 3600.0;
    case FaultKind::SensorOtherSlave:
      return sensors[(input + kSimulatedInputs / 2) % kSimulatedInputs].at(t);
    default:
      return right_C;
  }
}

std::uint16_t register_of_input(const EnvironmentModel& environment, std::size_t input,
                                nanoseconds t, const std::vector<BrokenInput>& broken) {
  // The reading is limited, as in the real module.
  const double reading_C =
      std::clamp(reading_of_input(environment, input, t, broken), -3276.0, 3276.0);
  std::uint16_t value = tenths(reading_C);
  for (const BrokenInput& fault : broken)
    if (fault.kind == FaultKind::SensorByteOrder && is_broken(fault, input))
      value = static_cast<std::uint16_t>(value << 8 | value >> 8);
  return value;
}

Registers zt2005(const EnvironmentModel& environment, nanoseconds t, std::uint8_t unit,
                 bool sensors_gone, const std::vector<BrokenInput>& broken) {
  Registers r;
  for (std::uint16_t i = 0; i < kSimulatedInputs; ++i) {
    const std::uint16_t value =
        sensors_gone ? std::uint16_t{0x8000u} : register_of_input(environment, i, t, broken);
    r.push_back({unit, RegisterSpace::Input, i, value});
    r.push_back({unit, RegisterSpace::Holding, i, value});
  }
  return r;
}

}  // namespace

double reading_of_input(const EnvironmentModel& environment, std::size_t input, nanoseconds t,
                        const std::vector<BrokenInput>& broken) {
  double reading_C = environment.temperature_C[input].at(t);
  for (const BrokenInput& fault : broken)
    if (is_broken(fault, input))
      reading_C = broken_reading_C(fault, environment, input, t, reading_C);
  return reading_C;
}

std::optional<ModbusModel> modbus_model(std::string_view name) {
  if (name == "indigo520_hmp") return ModbusModel::Indigo520Hmp;
  if (name == "comet_t7510") return ModbusModel::CometT7510;
  if (name == "zt2005_c8") return ModbusModel::Zt2005C8;
  return std::nullopt;
}

std::vector<SimulatedRegister> registers_of(const ModbusIdentity& identity,
                                            const EnvironmentModel& environment,
                                            nanoseconds since_start, bool sensors_gone,
                                            const std::vector<BrokenInput>& broken) {
  const Air air{environment.air_temperature_C.at(since_start),
                environment.air_pressure_hPa.at(since_start),
                environment.relative_humidity_percent.at(since_start)};
  switch (identity.model) {
    case ModbusModel::Indigo520Hmp:
      return indigo(air, sensors_gone);
    case ModbusModel::CometT7510:
      return comet(air, identity.serial_number);
    case ModbusModel::Zt2005C8:
      return zt2005(environment, since_start, identity.unit, sensors_gone, broken);
  }
  return {};
}

}  // namespace abbe::sim
