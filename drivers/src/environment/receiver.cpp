#include "abbe/drivers/environment/receiver.hpp"

#include <fmt/format.h>

#include <utility>

namespace abbe::drivers {

using Kind = EnvironmentFailure::Kind;

EnvironmentReceiver::EnvironmentReceiver(RegisterMap map, modbus::Transport transport)
    : map_(std::move(map)), transport_(transport) {
  for (const auto& proving : map_.proving) {
    proving_reads_.push_back(reads_for({proving.place}, map_.base_offset).front());
  }
  std::vector<RegisterPlace> places;
  for (const auto& measured : map_.measured) places.push_back(measured.place);
  reads_ = reads_for(places, map_.base_offset);
  spots_ = spots_in(reads_, places, map_.base_offset);
}

std::vector<EnvironmentReceiver::Spot> EnvironmentReceiver::spots_in(
    const std::vector<modbus::ReadRequest>& reads, const std::vector<RegisterPlace>& places,
    int base_offset) {
  std::vector<Spot> spots;
  for (const auto& place : places) {
    const int address = place.address + base_offset;
    for (std::size_t r = 0; r < reads.size(); ++r) {
      const auto& read = reads[r];
      if (read.unit != place.unit || read.function != place.function || address < read.address ||
          address + modbus::register_count(place.type) > read.address + read.count)
        continue;
      spots.push_back({r, 2u * static_cast<std::size_t>(address - read.address)});
      break;
    }
  }

  return spots;
}

bool is_refusal(const EnvironmentFailure& failure) noexcept {
  // Failures that a repetition of the request does not remove. With Modbus exceptions 1 to 3 the
  // device does not know the function, address or value; other exceptions may be temporary.
  return failure.kind == Kind::Unproven || failure.kind == Kind::Implausible ||
         (failure.kind == Kind::Exception && failure.exception <= 3);
}

std::string text_of(const EnvironmentFailure& failure, const RegisterMap& map) {
  const auto& q = failure.request;
  const auto asked = fmt::format("unit {} function {} address {}", q.unit,
                                 static_cast<int>(q.function), q.address);

  switch (failure.kind) {
    case Kind::None:
      return {};
    case Kind::Unasked:
      return "bytes without a request";
    case Kind::Malformed:
      return fmt::format("{}: {}", asked, modbus::name_of(failure.error));
    case Kind::Exception:
      return fmt::format(
          "{}: exception {}, {}{}", asked, failure.exception,
          modbus::name_of_exception(failure.exception),
          is_refusal(failure) ? fmt::format(": register map {} does not match", map.name) : "");
    case Kind::Unproven: {
      const auto& proving = map.proving[failure.index];
      return fmt::format("{}: {} is {}, not {}: wrong device or register map {} does not match",
                         asked, proving.name, failure.value, proving.expected, map.name);
    }
    case Kind::Implausible: {
      const auto& measured = map.measured[failure.index];
      const bool kelvin = measured.quantity == Quantity::AirTemperature ||
                          measured.quantity == Quantity::Temperature;
      const auto unit = kelvin ? " K" : measured.quantity == Quantity::AirPressure ? " Pa" : "";
      return fmt::format("{}: {} reads {:.6g}{}: register map {} does not match", asked,
                         measured.name, failure.value, unit, map.name);
    }
  }

  return "?";
}

}  // namespace abbe::drivers
