#include "abbe/drivers/environment/known_maps.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace abbe::drivers {
namespace {

using modbus::Function;
using modbus::RegisterType;
using modbus::WordOrder;

constexpr double kZeroCelsius_K = 273.15;
constexpr double kPascalsPerHectopascal = 100.0;
constexpr double kPerPercent = 0.01;

Error bad(std::string text) {
  return {ErrorCode::BadConfiguration, std::move(text)};
}

/// Vaisala M212287EN p. 73, 114 (Indigo520) and M212022EN p. 101 (HMP series): 32-bit floats, low
/// word first. The register numbers in the documentation count from 1, the addresses here from 0.
/// Unit 240 is the transmitter, 241 the probe on port 1.
RegisterMap indigo520_hmp() {
  const auto at = [](std::uint8_t unit, std::uint16_t address) {
    return RegisterPlace{unit, Function::ReadHoldingRegisters, address, RegisterType::Float32,
                         WordOrder::LowFirst};
  };

  const RegisterPlace status{241, Function::ReadHoldingRegisters, 0x0200, RegisterType::Uint16,
                             WordOrder::HighFirst};
  RegisterMap map;
  map.measured = {
      {"relative humidity", Quantity::RelativeHumidity, 0, at(241, 0x0000), kPerPercent, 0.0, {}},
      {"air temperature", Quantity::AirTemperature, 0, at(241, 0x0002), 1.0, kZeroCelsius_K, {}},
      {"air pressure", Quantity::AirPressure, 0, at(240, 0x002A), kPascalsPerHectopascal, 0.0, {}}};
  map.proving = {{"status of the probe", status, 1.0}};

  return map;
}

/// Comet Modbus description for Tx5xx/Tx6xx v3.2: int16 in units of 0.1; serial number in BCD.
RegisterMap comet_t7510(const KnownMapOptions& options) {
  const auto at = [&](std::uint16_t address, RegisterType type) {
    return RegisterPlace{options.unit, Function::ReadHoldingRegisters, address, type,
                         WordOrder::HighFirst};
  };

  constexpr auto kType = RegisterType::Int16;
  RegisterMap map;
  map.measured = {
      {"air temperature", Quantity::AirTemperature, 0, at(49, kType), 0.1, kZeroCelsius_K, {}},
      {"relative humidity",
       Quantity::RelativeHumidity,
       0,
       at(50, kType),
       0.1 * kPerPercent,
       0.0,
       {}},
      {"air pressure",
       Quantity::AirPressure,
       0,
       at(52, kType),
       0.1 * kPascalsPerHectopascal,
       0.0,
       {}}};
  map.proving = {{"serial number", at(4149, RegisterType::Bcd32),
                  static_cast<double>(options.serial_number.value_or(0))}};

  return map;
}

/// ICP DAS ZT-2005-C8 manual p. 42: inputs 30001 to 30008, int16, format "engineering units" of
/// 0.1 C.
RegisterMap zt2005_c8(const KnownMapOptions& options) {
  RegisterMap map;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    if (!options.inputs[i]) continue;
    MeasuredRegister m;
    m.name = i < options.input_names.size() ? options.input_names[i] : fmt::format("input {}", i);
    m.channel = *options.inputs[i];
    m.place = {options.unit, Function::ReadInputRegisters, static_cast<std::uint16_t>(i),
               RegisterType::Int16, WordOrder::HighFirst};
    m.scale = 0.1;
    m.offset = kZeroCelsius_K;
    // End values of the 16-bit range: broken wire, short circuit. The documentation does not
    // confirm this.
    m.unavailable = {-32768.0, 32767.0};
    map.measured.push_back(std::move(m));
  }

  return map;
}

constexpr std::string_view kIndigo = "vaisala-indigo520-hmp";
constexpr std::string_view kComet = "comet-t7510";
constexpr std::string_view kZt2005 = "icpdas-zt2005-c8";
constexpr std::size_t kZt2005Inputs = 8;

}  // namespace

const std::vector<std::string_view>& known_map_names() {
  static const std::vector<std::string_view> names{kIndigo, kComet, kZt2005};
  return names;
}

Result<RegisterMap> known_map(std::string_view name, const KnownMapOptions& options) {
  const auto& names = known_map_names();
  if (std::find(names.begin(), names.end(), name) == names.end())
    return tl::unexpected(bad(fmt::format("register map {}: no such map", name)));
  if (!options.serial_number && name == kComet)
    return tl::unexpected(
        bad(fmt::format("register map {}: needs the serial number, the only check that the "
                        "register addresses are not off by one",
                        name)));
  if (options.serial_number && name != kComet)
    return tl::unexpected(bad(
        fmt::format("register map {}: has no register for the serial number: remove it", name)));
  if (!options.inputs.empty() && name != kZt2005)
    return tl::unexpected(bad(fmt::format("register map {}: has no inputs to configure", name)));
  if (options.inputs.size() > kZt2005Inputs)
    return tl::unexpected(bad(fmt::format("register map {}: has {} inputs, not {}", name,
                                          kZt2005Inputs, options.inputs.size())));
  auto map = name == kIndigo  ? indigo520_hmp()
             : name == kComet ? comet_t7510(options)
                              : zt2005_c8(options);
  map.name = name;

  return map;
}

}  // namespace abbe::drivers
