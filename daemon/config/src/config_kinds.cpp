#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <type_traits>

#include "config_kind.hpp"

namespace abbe::daemon {
namespace {

/// The ConfigKind of each kind of device, in the order of DeviceConfigs.
template <class... Devices>
std::array<ConfigKind, sizeof...(Devices)> kinds_of(std::type_identity<std::tuple<Devices...>>) {
  return {Devices::value_type::kKind...};
}

std::string table_of(const ConfigKind& kind) {
  return fmt::format(fmt::runtime(kind.several ? "[[{}]]" : "[{}]"), kind.key);
}

/// The tables as text: "[a], [b] CONJUNCTION [c]".
std::string joined(const std::vector<std::string>& tables, std::string_view conjunction) {
  std::string text;
  for (std::size_t i = 0; i < tables.size(); ++i) {
    if (i > 0) text += i + 1 == tables.size() ? fmt::format(" {} ", conjunction) : ", ";
    text += tables[i];
  }

  return text;
}

bool has(const ConfigKind& kind, Capability capability) {
  switch (capability) {
    case Capability::TrackerPoints:
      return kind.points != nullptr;
    case Capability::Axes:
      return kind.axes != nullptr;
    case Capability::NamedAxes:
      return kind.axes != nullptr && !kind.axes_if_no_other;
    case Capability::CountedAxes:
      return kind.counted != nullptr;
    case Capability::Marks:
      return kind.marks != nullptr;
    case Capability::Touches:
      return kind.touches != nullptr;
    case Capability::Errors:
      return kind.points != nullptr || kind.touches != nullptr;
    case Capability::Motion:
      return kind.motion != nullptr;
    case Capability::Environment:
      return kind.environment != nullptr;
  }
  return false;
}

/// Calls the function `capability` of each kind and returns the first result that is not empty.
template <class Result>
Result first_with(Result (*ConfigKind::*capability)(const Config&), const Config& config) {
  for (const ConfigKind& kind : config_kinds()) {
    if (kind.*capability == nullptr) continue;
    if (auto result = (kind.*capability)(config)) return result;
  }

  return {};
}

}  // namespace

std::span<const ConfigKind> config_kinds() {
  static const auto kinds = kinds_of(std::type_identity<DeviceConfigs>{});
  return kinds;
}

std::vector<AxisReadings> axis_readings(const Config& config) {
  const bool own = axes_have_own_device(config);
  std::vector<AxisReadings> all;
  for (const ConfigKind& kind : config_kinds()) {
    if (kind.axes == nullptr || (own && kind.axes_if_no_other)) continue;
    if (auto readings = kind.axes(config)) all.push_back(std::move(*readings));
  }

  return all;
}

void refuse_claimed_axis(ClassifiedSection& table, std::string_view key, const std::string& axis,
                         std::string_view own, const Config& config) {
  for (const AxisReadings& other : axis_readings(config))
    if (std::ranges::find(other.axes, axis) != other.axes.end())
      table.fault(key, fmt::format("axis {} is claimed by [{}] and [{}]", axis, other.key, own));
}

bool axes_have_own_device(const Config& config) {
  return std::ranges::any_of(config_kinds(), [&config](const ConfigKind& kind) {
    return kind.axes != nullptr && !kind.axes_if_no_other && kind.axes(config);
  });
}

std::optional<TrackerSource> tracker_source(const Config& config) {
  return first_with(&ConfigKind::points, config);
}

std::optional<TouchSource> touch_source(const Config& config) {
  return first_with(&ConfigKind::touches, config);
}

std::optional<MotionSource> motion_source(const Config& config) {
  return first_with(&ConfigKind::motion, config);
}

std::optional<CountedAxes> counted_axes(const Config& config) {
  return first_with(&ConfigKind::counted, config);
}

const ReferenceMarks* reference_marks(const Config& config) {
  return first_with(&ConfigKind::marks, config);
}

std::optional<std::chrono::nanoseconds> time_of_axis_samples(const Config& config, double periods) {
  for (const ConfigKind& kind : config_kinds()) {
    if (kind.time_of_axis_samples == nullptr) continue;
    if (const auto time = kind.time_of_axis_samples(config, periods)) return time;
  }

  return std::nullopt;
}

std::vector<EnvironmentSource> environment_sources(const Config& config) {
  std::vector<EnvironmentSource> all;
  for (const ConfigKind& kind : config_kinds()) {
    if (kind.environment == nullptr) continue;
    const auto sources = kind.environment(config);
    all.insert(all.end(), sources.begin(), sources.end());
  }
  return all;
}

protocol::EnvironmentMask measured_environment(const Config& config) {
  protocol::EnvironmentMask all = 0;
  for (const auto& source : environment_sources(config)) all |= source.measured;
  return all;
}

std::string tables_with(Capability capability, std::string_view conjunction) {
  std::vector<std::string> tables;
  for (const ConfigKind& kind : config_kinds())
    if (has(kind, capability)) tables.push_back(table_of(kind));
  return joined(tables, conjunction);
}

std::string needed_for(Capability capability) {
  std::vector<std::string> entries;
  for (const ConfigKind& kind : config_kinds()) {
    if (!has(kind, capability)) continue;
    entries.push_back(kind.needs.empty() ? table_of(kind)
                                         : fmt::format("{} {}", table_of(kind), kind.needs));
  }

  return joined(entries, "or");
}

}  // namespace abbe::daemon
