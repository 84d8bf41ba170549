#pragma once
/// The kinds of devices that a configuration can have, one per line. Their order is the order in
/// which their tables are read and shown. drivers/docs/adding_a_device.md describes how to add a
/// kind.

#include <optional>
#include <tuple>
#include <type_traits>
#include <vector>

#include "abbe/config/kinds/axis_lines.hpp"
#include "abbe/config/kinds/counter_card.hpp"
#include "abbe/config/kinds/encoder.hpp"
#include "abbe/config/kinds/environment.hpp"
#include "abbe/config/kinds/measuring_machine.hpp"
#include "abbe/config/kinds/reference_card.hpp"
#include "abbe/config/kinds/touch_probe.hpp"
#include "abbe/config/kinds/tracker.hpp"

namespace abbe::daemon {

/// The configured devices of every kind. optional: at most one device of the kind; vector: any
/// number of devices, in the order of the file.
using DeviceConfigs = std::tuple<std::optional<TrackerConfig>, std::optional<EncoderConfig>,
                                 std::optional<CounterCardConfig>, std::optional<AxisLinesConfig>,
                                 std::optional<ReferenceConfig>, std::optional<ProbeConfig>,
                                 std::optional<CmmConfig>, std::vector<EnvironmentConfig>>;

template <class Element, class... Elements>
[[nodiscard]] constexpr bool has_element(std::type_identity<std::tuple<Elements...>>) noexcept {
  return (std::is_same_v<Element, Elements> || ...);
}

/// The element of `devices` for a kind: an optional or a vector of `Kind`.
template <class Kind, class Devices>
[[nodiscard]] auto& devices_of(Devices& devices) noexcept {
  if constexpr (has_element<std::optional<Kind>>(std::type_identity<DeviceConfigs>{}))
    return std::get<std::optional<Kind>>(devices);
  else
    return std::get<std::vector<Kind>>(devices);
}

}  // namespace abbe::daemon
