#pragma once
/// The register contents of the simulated Modbus devices. Written from the manufacturers'
/// documentation, independently of the driver's register maps, so that tests detect an error in
/// those maps. Pure.

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/sim/environment_model.hpp"
#include "abbe/sim/fault.hpp"

namespace abbe::sim {

enum class ModbusModel {
  Indigo520Hmp,  ///< units 240 (transmitter with barometer) and 241 (HMP probe)
  CometT7510,    ///< any unit; read-only
  Zt2005C8,      ///< eight inputs, engineering units
};
/// The model of the name "indigo520_hmp", "comet_t7510" or "zt2005_c8"; nullopt for any other name.
[[nodiscard]] std::optional<ModbusModel> modbus_model(std::string_view name);

enum class RegisterSpace { Holding, Input };

struct SimulatedRegister {
  std::uint8_t unit = 1;  ///< 0: every unit
  RegisterSpace space = RegisterSpace::Holding;
  std::uint16_t address = 0;  ///< address on the wire
  std::uint16_t value = 0;
};

struct ModbusIdentity {
  ModbusModel model = ModbusModel::CometT7510;
  std::uint32_t serial_number = 20969999;
  std::uint8_t unit = 1;  ///< address of CometT7510 and Zt2005C8 on a serial line
};

/// A fault of a temperature input of Zt2005C8 from the instant `since` on, counted as `since_start`
/// below.
struct BrokenInput {
  FaultKind kind = FaultKind::SensorValue;  ///< one of the kinds SensorValue to SensorOtherSlave
  std::uint8_t input = 0;                   ///< counted from 1; 0: all inputs
  double value = 0.0;
  std::chrono::nanoseconds since{};
};
/// The temperature that input number `input` (from 0) sends, in C.
[[nodiscard]] double reading_of_input(const EnvironmentModel& environment, std::size_t input,
                                      std::chrono::nanoseconds since_start,
                                      const std::vector<BrokenInput>& broken);

/// `sensors_gone`: simulates an unplugged probe and broken sensor wires.
[[nodiscard]] std::vector<SimulatedRegister> registers_of(
    const ModbusIdentity& identity, const EnvironmentModel& environment,
    std::chrono::nanoseconds since_start, bool sensors_gone,
    const std::vector<BrokenInput>& broken = {});

}  // namespace abbe::sim
