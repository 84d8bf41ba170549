#include "abbe/drivers/environment/register_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace abbe::drivers {
namespace {

tl::unexpected<Error> bad(const RegisterMap& map, std::string_view what) {
  return tl::unexpected(
      Error{ErrorCode::BadConfiguration, fmt::format("register map {}: {}", map.name, what)});
}

bool on_the_wire(const RegisterPlace& place, int base_offset) {
  const int first = place.address + base_offset;
  return first >= 0 && first + modbus::register_count(place.type) <= 0x10000;
}

std::string_view name_of(Quantity quantity) {
  switch (quantity) {
    case Quantity::AirTemperature:
      return "air temperature";
    case Quantity::AirPressure:
      return "air pressure";
    case Quantity::RelativeHumidity:
      return "relative humidity";
    case Quantity::Temperature:
      return "temperature";
  }
  return "?";
}

}  // namespace

PlausibleRange plausible_range(Quantity quantity) noexcept {
  switch (quantity) {
    case Quantity::AirTemperature:
      return {233.15, 358.15};
    case Quantity::AirPressure:
      return {50'000.0, 120'000.0};
    case Quantity::RelativeHumidity:
      return {0.0, 1.05};  // sensors may read slightly more than 1 at saturation
    case Quantity::Temperature:
      return {223.15, 473.15};
  }
  return {0.0, 0.0};
}

protocol::EnvironmentMask mask_of(const MeasuredRegister& measured) noexcept {
  switch (measured.quantity) {
    case Quantity::AirTemperature:
      return protocol::kAirTemperature;
    case Quantity::AirPressure:
      return protocol::kAirPressure;
    case Quantity::RelativeHumidity:
      return protocol::kRelativeHumidity;
    case Quantity::Temperature:
      return protocol::temperature_bit(measured.channel);
  }
  return 0;
}

Result<void> check(const RegisterMap& map) {
  if (map.measured.empty()) return bad(map, "no register is measured");
  protocol::EnvironmentMask seen = 0;
  std::vector<RegisterPlace> places;

  for (const auto& m : map.measured) {
    if (m.quantity == Quantity::Temperature && m.channel >= protocol::kMaxTemperatures)
      return bad(map, fmt::format("{}: channel {} is not in 0 to {}", m.name, m.channel,
                                  protocol::kMaxTemperatures - 1));
    if ((seen & mask_of(m)) != 0)
      return bad(map, fmt::format("{} is measured twice", name_of(m.quantity)));
    seen |= mask_of(m);
    if (!std::isfinite(m.scale) || m.scale == 0.0 || !std::isfinite(m.offset))
      return bad(map, fmt::format("{}: scale must not be 0", m.name));
    if (!on_the_wire(m.place, map.base_offset))
      return bad(map, fmt::format("{}: address {} with base offset {} is not in 0 to 65535", m.name,
                                  m.place.address, map.base_offset));
    places.push_back(m.place);
  }

  for (const auto& p : map.proving) {
    if (!on_the_wire(p.place, map.base_offset))
      return bad(map, fmt::format("{}: address {} with base offset {} is not in 0 to 65535", p.name,
                                  p.place.address, map.base_offset));
  }

  if (reads_for(places, map.base_offset).size() + map.proving.size() > kMaxReads)
    return bad(map, fmt::format("needs more than {} reads", kMaxReads));
  return {};
}

std::vector<modbus::ReadRequest> reads_for(const std::vector<RegisterPlace>& places,
                                           int base_offset) {
  auto sorted = places;
  const auto key = [](const RegisterPlace& p) { return std::tuple{p.unit, p.function, p.address}; };
  std::sort(sorted.begin(), sorted.end(),
            [&](const auto& a, const auto& b) { return key(a) < key(b); });
  std::vector<modbus::ReadRequest> reads;

  for (const auto& place : sorted) {
    const int address = place.address + base_offset;
    const int end = address + modbus::register_count(place.type);
    if (!reads.empty()) {
      auto& last = reads.back();
      const bool touches = last.unit == place.unit && last.function == place.function &&
                           address <= last.address + last.count;
      if (touches && end - last.address <= static_cast<int>(modbus::kMaxRegisters)) {
        last.count = static_cast<std::uint16_t>(std::max<int>(last.count, end - last.address));
        continue;
      }
    }

    reads.push_back({place.unit, place.function, static_cast<std::uint16_t>(address),
                     modbus::register_count(place.type)});
  }

  return reads;
}

}  // namespace abbe::drivers
