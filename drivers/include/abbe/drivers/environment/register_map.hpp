#pragma once
/// Describes the registers of a Modbus device as data. A map has measured registers, and proving
/// registers (serial number, status word), which show that the intended device answers and that the
/// map fits. Proving registers are read first on every connection.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/error.hpp"
#include "abbe/protocol/modbus/read.hpp"
#include "abbe/protocol/modbus/registers.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace modbus = protocol::modbus;

struct RegisterPlace {
  std::uint8_t unit = 1;
  modbus::Function function = modbus::Function::ReadHoldingRegisters;
  std::uint16_t address = 0;  ///< address on the wire, from 0, before `base_offset` of the map
  modbus::RegisterType type = modbus::RegisterType::Int16;
  modbus::WordOrder order = modbus::WordOrder::HighFirst;
};

enum class Quantity : std::uint8_t { AirTemperature, AirPressure, RelativeHumidity, Temperature };

/// Limits of plausible values, SI. A value outside is treated as not available; in the first round
/// of a connection such a value means that the map does not fit the device.
struct PlausibleRange {
  double min;
  double max;
};
/// Air: -40 to 85 C, 500 to 1200 hPa, 0 to 105 % relative humidity. Temperatures of scales and
/// parts: -50 to 200 C.
[[nodiscard]] PlausibleRange plausible_range(Quantity quantity) noexcept;

/// A register with a measured quantity: value [SI] = register * scale + offset.
struct MeasuredRegister {
  std::string name;  ///< "air temperature", "scale X"
  Quantity quantity = Quantity::Temperature;
  std::uint8_t channel = 0;  ///< Temperature only: index into EnvironmentSample::temperature_K
  RegisterPlace place;
  double scale = 1.0;
  double offset = 0.0;
  /// Register values that mean "not available" (broken sensor, no probe).
  std::vector<double> unavailable;
};
[[nodiscard]] protocol::EnvironmentMask mask_of(const MeasuredRegister& measured) noexcept;

struct ProvingRegister {
  std::string name;  ///< "serial number"
  RegisterPlace place;
  double expected = 0.0;  ///< register value, unscaled
};

struct RegisterMap {
  std::string name;     ///< "comet-t7510"
  int base_offset = 0;  ///< added to every address: -1 where the documentation counts from 1
  std::vector<MeasuredRegister> measured;
  std::vector<ProvingRegister> proving;
};

/// Error BadConfiguration: no measured register, a quantity twice, a channel not below
/// kMaxTemperatures, a scale of 0, an address outside 0 to FFFFh, more reads than kMaxReads.
[[nodiscard]] Result<void> check(const RegisterMap& map);

/// The smallest number of reads that cover all `places`: one read covers adjacent registers of the
/// same unit (Modbus address) and function.
[[nodiscard]] std::vector<modbus::ReadRequest> reads_for(const std::vector<RegisterPlace>& places,
                                                         int base_offset);

inline constexpr std::size_t kMaxReads = 32;

}  // namespace abbe::drivers
