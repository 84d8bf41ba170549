#include "abbe/sim/line_axes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "abbe/sim/noise.hpp"

namespace abbe::sim {
namespace {

constexpr int kValueDigits = 12;

std::string value_text(const lines::ValueFormat& format, const lines::ValueColumn& column,
                       double value) {
  if (!std::isnan(value))
    return fmt::format("{:.{}f}", (value - column.offset) / column.scale, kValueDigits);
  return format.no_value_count == 0 ? "nan" : std::string{format.no_value[0].text()};
}

}  // namespace

std::string print_values(const lines::ValueFormat& format, const std::vector<double>& values,
                         DeviceTime t, bool valid) {
  return printed(format, [&](std::size_t i) -> std::string {
    const lines::ValueColumn& column = format.columns[i];
    switch (column.use) {
      case lines::ColumnUse::Value:
        return value_text(format, column, values[column.value]);
      case lines::ColumnUse::Time:
        return time_text(t, format.time_unit);
      case lines::ColumnUse::Status:
        return status_text(format, valid);
      case lines::ColumnUse::Ignored:
        break;
    }
    return "N1";
  });
}

LineAxes::LineAxes(LineAxesOptions options, const VirtualMachine& machine, HostTime now)
    : LineSource(options.times, now), options_(std::move(options)), machine_(machine) {}

std::string LineAxes::print(const Instant& instant) const {
  std::vector<double> readings;
  for (const MeasuredAxis& axis : options_.axes) {
    const auto stream = static_cast<std::uint64_t>(NoiseStream::Encoder) + readings.size() + 1;
    readings.push_back(reading(axis, machine_, instant.measured) +
                       options_.noise * gaussian(options_.times.seed, stream, instant.index));
  }
  return print_values(options_.format, readings, instant.shown, instant.valid);
}

}  // namespace abbe::sim
