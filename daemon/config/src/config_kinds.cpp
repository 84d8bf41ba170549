#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <type_traits>

#include "config_kind.hpp"

namespace abbe::daemon {
namespace {

/// The kinds of the elements of DeviceConfigs, in their order.
template <class... Devices>
std::array<ConfigKind, sizeof...(Devices)> kinds_of(std::type_identity<std::tuple<Devices...>>) {
  return {Devices::value_type::kKind...};
}

template <class Condition>
std::vector<std::string_view> tables_where(const Condition& condition) {
  std::vector<std::string_view> tables;
  for (const ConfigKind& kind : config_kinds())
    if (condition(kind)) tables.push_back(kind.table);
  return tables;
}

std::string joined(const std::vector<std::string_view>& tables, std::string_view conjunction) {
  std::string text;
  for (std::size_t i = 0; i < tables.size(); ++i) {
    if (i > 0) text += i + 1 == tables.size() ? fmt::format(" {} ", conjunction) : ", ";
    text += tables[i];
  }

  return text;
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

bool axes_have_own_device(const Config& config) {
  if (config.encoder || config.counter_card) return true;
  return std::ranges::any_of(config_kinds(), [&config](const ConfigKind& kind) {
    return kind.axes != nullptr && !kind.axes_if_no_other && kind.axes(config);
  });
}

std::optional<TouchSource> touch_source(const Config& config) {
  for (const ConfigKind& kind : config_kinds()) {
    if (kind.touches == nullptr) continue;
    if (auto source = kind.touches(config)) return source;
  }

  return std::nullopt;
}

std::string axis_tables(std::string_view conjunction) {
  return joined(tables_where([](const ConfigKind& kind) { return kind.axes != nullptr; }),
                conjunction);
}

std::string touch_tables(std::string_view conjunction) {
  return joined(tables_where([](const ConfigKind& kind) { return kind.touches != nullptr; }),
                conjunction);
}

std::string moving_tables() {
  return joined(tables_where([](const ConfigKind& kind) { return kind.moves; }), "or");
}

}  // namespace abbe::daemon
