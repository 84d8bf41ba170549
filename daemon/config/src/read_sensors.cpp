#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/config/capabilities.hpp"
#include "readers.hpp"

namespace abbe::daemon {
namespace {

constexpr double kSecondsPerMinute = 60.0;

/// The unit of a quantity in the file: value [SI] = number / per_si + zero.
struct FileUnit {
  std::string_view name;  ///< unit in keys of values: "C", "hPa", "percent"
  /// unit in keys of differences and rates: "K", "hPa", "percent"
  std::string_view difference_name;
  double per_si;
  double zero;
};

FileUnit unit_of(std::string_view sensor) {
  if (sensor == "air_pressure") return {"hPa", "hPa", 0.01, 0.0};
  if (sensor == "relative_humidity") return {"percent", "percent", 100.0, 0.0};
  return {"C", "K", 1.0, kZeroCelsius_K};
}

bool is_temperature(const Config& config, const std::string& name) {
  return name == "air_temperature" ||
         std::ranges::find(config.temperatures, name) != config.temperatures.end();
}

void read_range(Section& section, const FileUnit& unit, SensorLimitConfig& limit) {
  const std::string key = fmt::format("expected_{}", unit.name);
  std::vector<double> range;
  if (!section.get(key, range, Unit{unit.per_si})) return;
  if (range.size() != 2 || !(range[0] < range[1]))
    return section.fault(key, "must be two numbers, the lowest and the highest: [5, 50]");
  limit.lowest = range[0] + unit.zero;
  limit.highest = range[1] + unit.zero;
}

void read_positive(Section& section, const std::string& key, double per_si,
                   std::optional<double>& out) {
  double value = 0.0;
  if (section.get(key, value, Unit{per_si}, kPositive)) out = value;
}

void read_twin(Section& section, const Config& config, SensorLimitConfig& limit) {
  if (!is_temperature(config, limit.name)) return;
  if (section.get("twin", limit.twin)) {
    if (limit.twin == limit.name) section.fault("twin", "is the sensor itself");
    if (!is_temperature(config, limit.twin)) section.fault("twin", "no device measures it");
  }
  section.get("max_twin_difference_K", limit.most_twin_difference_K, kPlain, kPositive);
}

SensorLimitConfig read_limit(Section& section, const Config& config) {
  SensorLimitConfig limit;
  if (section.get("name", limit.name, Need::Required) && !is_temperature(config, limit.name) &&
      limit.name != "air_pressure" && limit.name != "relative_humidity")
    section.fault("name", fmt::format("no {} measures it: check the name; of the air: "
                                      "air_temperature, air_pressure, relative_humidity",
                                      tables_with(Capability::Environment)));

  const FileUnit unit = unit_of(limit.name);
  read_range(section, unit, limit);
  read_positive(section, fmt::format("max_rate_{}_per_min", unit.difference_name),
                unit.per_si * kSecondsPerMinute, limit.most_per_s);
  read_positive(section, fmt::format("tolerance_{}", unit.difference_name), unit.per_si,
                limit.tolerance);
  read_twin(section, config, limit);
  section.close();
  return limit;
}

/// While a reading is refused, the last good value is used, but only for the time hold_s. This time
/// must reach to the next reading, which may come somewhat later than one period.
constexpr double kHoldPerPeriod = 1.5;

/// Reads hold_s. Its default is the general default, or longer if a device has a longer period.
void read_hold(Section& sensors, Config& out) {
  const auto seconds = [](std::chrono::nanoseconds t) {
    return std::chrono::duration<double>(t).count();
  };
  auto& hold = out.sensors.hold;
  const bool given = sensors.has("hold_s");
  sensors.get("hold_s", hold, kPlain, {0.0, 3600.0});
  if (!out.sensors.check || hold <= std::chrono::nanoseconds{0}) return;

  for (const EnvironmentSource& device : environment_sources(out)) {
    const auto needed =
        std::chrono::duration_cast<std::chrono::nanoseconds>(kHoldPerPeriod * device.period);
    if (needed <= hold) continue;
    if (given)
      sensors.fault("hold_s",
                    fmt::format("{} s is shorter than {} times period_s = {} of \"{}\": a value "
                                "would not be held until the next reading; give at least {}, or 0: "
                                "no value is held",
                                seconds(hold), kHoldPerPeriod, seconds(device.period),
                                device.device, seconds(needed)));
    else
      hold = needed;
  }
}

}  // namespace

void read_sensors(ClassifiedSection& root, Config& out) {
  Section sensors = root.operation_table("sensors");
  SensorsConfig& config = out.sensors;
  sensors.get("check", config.check);
  read_hold(sensors, out);
  sensors.get("forget_s", config.forget, kPlain, {1.0, 86'400.0});
  sensors.get("start_spread_K", config.start_spread_K, kPlain, kPositive);
  // The air of a hall changes by several K per hour; a slower correction could never follow it.
  sensors.get("correction_K_per_min", config.correction_K_per_s, {kSecondsPerMinute},
              {0.1, std::numeric_limits<double>::infinity()});

  std::set<std::string> named;
  for (auto& section : sensors.children("limit")) {
    auto limit = read_limit(section, out);
    if (!named.insert(limit.name).second) section.fault("name", "has two [[sensors.limit]] tables");
    config.limits.push_back(std::move(limit));
  }
  sensors.close();
}

}  // namespace abbe::daemon
