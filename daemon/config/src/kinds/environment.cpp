#include "abbe/config/kinds/environment.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "abbe/base/units.hpp"
#include "abbe/drivers/environment/known_maps.hpp"
#include "abbe/drivers/environment/link.hpp"
#include "classified_section.hpp"
#include "config_kind.hpp"
#include "message_bounds.hpp"
#include "plausible.hpp"

namespace abbe::daemon {

namespace {

using drivers::Quantity;
using drivers::modbus::Function;
using drivers::modbus::RegisterType;
using drivers::modbus::WordOrder;

constexpr std::string_view kCustom = "custom";

template <class Value>
using Words = std::vector<std::pair<std::string_view, Value>>;
const Words<Function> kRegisters{{"holding", Function::ReadHoldingRegisters},
                                 {"input", Function::ReadInputRegisters}};
const Words<RegisterType> kTypes{
    {"int16", RegisterType::Int16},     {"uint16", RegisterType::Uint16},
    {"int32", RegisterType::Int32},     {"uint32", RegisterType::Uint32},
    {"float32", RegisterType::Float32}, {"bcd16", RegisterType::Bcd16},
    {"bcd32", RegisterType::Bcd32}};
const Words<WordOrder> kOrders{{"high_first", WordOrder::HighFirst},
                               {"low_first", WordOrder::LowFirst}};

template <class Value>
std::string_view word_of(const Words<Value>& words, Value value) {
  const auto found = std::ranges::find(words, value, &std::pair<std::string_view, Value>::second);
  return found == words.end() ? std::string_view{} : found->first;
}

/// Adds a temperature name to `names` and returns its index, the channel. Adds a fault if the name
/// exists already, or if the largest number of channels is reached.
std::uint8_t channel_of(const std::string& name, ClassifiedSection& section, std::string_view key,
                        std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) {
    section.fault(key, fmt::format("temperature \"{}\" is measured twice", name));
    return static_cast<std::uint8_t>(found - names.begin());
  }

  names.push_back(name);
  if (names.size() > protocol::kMaxTemperatures)
    section.fault(key,
                  fmt::format("temperature \"{}\" is number {}, but all [[environment]] tables "
                              "together may measure at most {}: remove one",
                              name, names.size(), protocol::kMaxTemperatures));
  return static_cast<std::uint8_t>((names.size() - 1) % protocol::kMaxTemperatures);
}

void read_modbus_address(ClassifiedSection& device, drivers::ModbusAddress& out) {
  const bool serial = device.has("serial");
  if (serial == device.has("host")) {
    device.fault(serial ? "serial" : "", "needs one of host (Modbus TCP) and serial (Modbus RTU)");
  }

  if (!serial) {
    drivers::ModbusTcp tcp;
    get_host(device, operation("host"), tcp.host);
    device.get_integer(operation("port"), tcp.port, 1, 65535);
    for (const auto key : {"baud", "parity", "stop_bits"})
      if (device.has(key)) device.fault(key, "has no meaning without serial");
    out = tcp;
    return;
  }

  drivers::ModbusSerial line;
  device.get(operation("serial"), line.path);
  device.get_integer(operation("baud"), line.baud, 300, 4'000'000);
  device.get_word<drivers::Parity>(operation("parity"), line.parity,
                                   {{"none", drivers::Parity::None},
                                    {"even", drivers::Parity::Even},
                                    {"odd", drivers::Parity::Odd}});
  device.get_integer(operation("stop_bits"), line.stop_bits, 1, 2);

  if (device.has("port")) device.fault("port", "has no meaning with serial");
  out = line;
}

drivers::RegisterPlace read_place(ClassifiedSection& section, std::uint8_t unit) {
  drivers::RegisterPlace place;
  place.unit = unit;
  section.get_integer(stated("unit"), place.unit, 0, 255);
  section.get_word<Function>(stated("registers"), place.function, kRegisters);
  section.get_integer(stated("address"), place.address, 0, 65535, Need::Required);
  section.get_word<RegisterType>(stated("type"), place.type, kTypes, Need::Required);
  section.get_word<WordOrder>(stated("word_order"), place.order, kOrders);

  return place;
}

/// A unit of a register: SI value = scale * value + offset.
struct RegisterUnit {
  Quantity quantity;  // Temperature: also for AirTemperature
  double scale;
  double offset;
};

/// The unit must be a unit of the quantity: a pressure in C is a fault.
void read_unit(ClassifiedSection& section, drivers::MeasuredRegister& out) {
  static const std::vector<std::pair<std::string_view, RegisterUnit>> kUnits{
      {"C", {Quantity::Temperature, 1.0, kZeroCelsius_K}},
      {"K", {Quantity::Temperature, 1.0, 0.0}},
      {"Pa", {Quantity::AirPressure, 1.0, 0.0}},
      {"hPa", {Quantity::AirPressure, 100.0, 0.0}},
      {"mbar", {Quantity::AirPressure, 100.0, 0.0}},
      {"kPa", {Quantity::AirPressure, 1e3, 0.0}},
      {"%", {Quantity::RelativeHumidity, 0.01, 0.0}},
      {"1", {Quantity::RelativeHumidity, 1.0, 0.0}}};
  std::vector<std::pair<std::string_view, std::size_t>> words;

  for (std::size_t i = 0; i < kUnits.size(); ++i) words.emplace_back(kUnits[i].first, i);
  std::size_t index = 0;
  double scale = 1.0;
  double offset = 0.0;
  section.get(stated("scale"), scale, kPlain, kAny);
  section.get(stated("offset"), offset, kPlain, kAny);
  if (scale == 0.0) section.fault("scale", "must not be 0");
  if (!section.get_word<std::size_t>(stated("quantity_unit"), index, words, Need::Required)) return;
  const RegisterUnit& unit = kUnits[index].second;
  const auto wanted =
      out.quantity == Quantity::AirTemperature ? Quantity::Temperature : out.quantity;
  if (unit.quantity != wanted) section.fault("quantity_unit", "is not a unit of the quantity");
  out.scale = scale * unit.scale;
  out.offset = offset * unit.scale + unit.offset;
}

drivers::MeasuredRegister read_measured(ClassifiedSection& section, std::uint8_t unit,
                                        std::vector<std::string>& names) {
  drivers::MeasuredRegister out;
  section.get_word<Quantity>(stated("quantity"), out.quantity,
                             {{"air_temperature", Quantity::AirTemperature},
                              {"air_pressure", Quantity::AirPressure},
                              {"relative_humidity", Quantity::RelativeHumidity},
                              {"temperature", Quantity::Temperature}},
                             Need::Required);
  const bool named =
      section.get(operation("name"), out.name,
                  out.quantity == Quantity::Temperature ? Need::Required : Need::Optional);
  if (out.quantity == Quantity::Temperature && named)
    out.channel = channel_of(out.name, section, "name", names);
  if (!named)
    out.name = out.quantity == Quantity::AirPressure      ? "air pressure"
               : out.quantity == Quantity::AirTemperature ? "air temperature"
                                                          : "relative humidity";
  out.place = read_place(section, unit);
  read_unit(section, out);
  section.get(stated("unavailable"), out.unavailable, kPlain);
  section.close();

  return out;
}

void read_custom_map(ClassifiedSection& device, std::uint8_t unit, std::vector<std::string>& names,
                     drivers::RegisterMap& map) {
  map.name = kCustom;
  for (auto& section : device.children("measured", "name"))
    map.measured.push_back(read_measured(section, unit, names));
  for (auto& section : device.children("proving", "name")) {
    drivers::ProvingRegister proving;
    section.get(operation("name"), proving.name, Need::Required);
    proving.place = read_place(section, unit);
    section.get(operation("expected"), proving.expected, kPlain, kAny, Need::Required);
    section.close();
    map.proving.push_back(std::move(proving));
  }
}

/// Returns false if it added a fault.
bool read_known_map(ClassifiedSection& device, const std::string& name, std::uint8_t unit,
                    std::vector<std::string>& names, drivers::RegisterMap& map) {
  drivers::KnownMapOptions options;
  options.unit = unit;
  std::uint32_t serial = 0;
  if (device.get_integer(operation("serial_number"), serial, 0, 99'999'999))
    options.serial_number = serial;
  device.get(stated("inputs"), options.input_names);

  for (const auto& input : options.input_names) {
    if (input.empty()) {
      options.inputs.emplace_back();
    } else {
      options.inputs.emplace_back(channel_of(input, device, "inputs", names));
    }
  }

  auto known = drivers::known_map(name, options);
  if (!known) {
    device.fault("map", known.error().text);
    return false;
  }

  map = std::move(*known);
  return true;
}

void read_map(ClassifiedSection& device, std::vector<std::string>& names,
              drivers::RegisterMap& map) {
  std::vector<std::pair<std::string_view, std::string>> words{{kCustom, std::string{kCustom}}};
  for (const auto name : drivers::known_map_names()) words.emplace_back(name, std::string{name});
  std::string name;
  std::uint8_t unit = 1;
  device.get_integer(stated("unit"), unit, 0, 255);

  if (!device.get_word<std::string>(stated("map"), name, words, Need::Required)) {
    for (const auto key : {"measured", "proving", "inputs", "serial_number", "base_offset"})
      static_cast<void>(device.has(key));
    return;
  }

  bool valid_map = true;
  if (name == kCustom) {
    read_custom_map(device, unit, names, map);
  } else {
    valid_map = read_known_map(device, name, unit, names, map);
  }

  device.get_integer(stated("base_offset"), map.base_offset, -1, 1);
  if (!valid_map || names.size() > protocol::kMaxTemperatures) return;  // already reported
  if (const auto valid = drivers::check(map); !valid) device.fault("map", valid.error().text);
}

EnvironmentConfig read_device(ClassifiedSection& device, Config& out) {
  EnvironmentConfig config;
  get_bounded(device, operation("name"), config.name, bound_of<v1::EnvironmentSample>("device"),
              Need::Required);
  read_modbus_address(device, config.address);
  read_map(device, out.temperatures, config.map);
  device.get(operation("period_s"), config.period, kPlain, {0.05, 3600.0});
  device.get(operation("answer_timeout_ms"), config.answer_timeout, kMilli, {10.0, 60'000.0});
  device.close();
  return config;
}

/// Adds a fault if another device on the same serial line has another baud rate, parity or number
/// of stop bits: the line has only one setting.
void check_line(const EnvironmentConfig& config, const Config& out, ClassifiedSection& section) {
  for (const auto& other : out.of<EnvironmentConfig>()) {
    if (!drivers::same_line(config.address, other.address) ||
        drivers::same_settings(config.address, other.address))
      continue;
    section.fault(
        "serial",
        fmt::format(
            "[[environment]] \"{}\" and [[environment]] \"{}\" are on one serial line "
            "with different settings ({}; {}): give both the same baud, parity and stop_bits",
            config.name, other.name, drivers::text_of(config.address),
            drivers::text_of(other.address)));
    return;
  }
}

void read_environment(ClassifiedSection& root, Config& out, StreamNames& names) {
  protocol::EnvironmentMask seen = 0;

  for (auto& section : root.children("environment", "name")) {
    auto config = read_device(section, out);
    names.take(config.name, section);
    check_line(config, out, section);
    for (const auto& measured : config.map.measured) {
      const auto bit = drivers::mask_of(measured);
      if ((seen & bit) != 0 && measured.quantity != Quantity::Temperature)
        section.fault("map", fmt::format("{} is measured by two devices", measured.name));
      seen = static_cast<protocol::EnvironmentMask>(seen | bit);
    }
    out.of<EnvironmentConfig>().push_back(std::move(config));
  }
}

std::vector<std::string> environment_summary(const Config& config) {
  std::vector<std::string> texts;
  for (const auto& device : config.of<EnvironmentConfig>())
    texts.push_back(
        fmt::format("\"{}\" ({}) at {}", device.name, device.map.name, text_of(device.address)));
  return texts;
}

std::vector<EnvironmentSource> measured_by_devices(const Config& config) {
  std::vector<EnvironmentSource> all;
  for (const auto& device : config.of<EnvironmentConfig>()) {
    auto& source =
        all.emplace_back(EnvironmentSource{.device = device.name, .period = device.period});
    for (const auto& measured : device.map.measured) source.measured |= drivers::mask_of(measured);
  }
  return all;
}

/// All that the value of a register depends on. A member that is added to these structs does not
/// compile until it is considered here.
std::string register_text(const drivers::RegisterMap& map,
                          const drivers::MeasuredRegister& measured) {
  const auto& [name, quantity, channel, place, scale, offset, unavailable] = measured;
  const auto& [unit, function, address, type, order] = place;
  return fmt::format("{} register {} of unit {}, {} {}, scale {}, offset {}, unavailable [{}]",
                     word_of(kRegisters, function), address + map.base_offset, unit,
                     word_of(kTypes, type), word_of(kOrders, order), number_text(scale),
                     number_text(offset), numbers_text(unavailable, 1.0));
}

bool corrects_a_scale(const drivers::MeasuredRegister& measured, const Config& config) {
  return measured.quantity == Quantity::Temperature &&
         std::ranges::any_of(config.thermal, [&measured](const ThermalConfig& thermal) {
           return thermal.temperature == measured.channel;
         });
}

void state_environment(ClassifiedSection& root, const Config& config) {
  const auto [readings, measurements] = environment_meaning(config);
  for (const auto& [key, value] : readings) root.state(Role::Reading, key, value);
  for (const auto& [key, value] : measurements) root.state(Role::Measurement, key, value);
}

}  // namespace

Meaning environment_meaning(const Config& config) {
  Meaning meaning;
  for (const auto& device : config.of<EnvironmentConfig>())
    for (const auto& measured : device.map.measured) {
      const auto entry = fmt::format("environment.{}.register", measured.name);
      if (corrects_a_scale(measured, config))
        set_entry(meaning.readings, entry, register_text(device.map, measured));
      else if (config.air.assumed_index && measured.quantity != Quantity::Temperature)
        set_entry(meaning.measurements, entry, register_text(device.map, measured));
    }
  return meaning;
}

const ConfigKind EnvironmentConfig::kKind{.key = "environment",
                                          .several = true,
                                          .read = &read_environment,
                                          .state = &state_environment,
                                          .summary = &environment_summary,
                                          .environment = &measured_by_devices};

}  // namespace abbe::daemon
