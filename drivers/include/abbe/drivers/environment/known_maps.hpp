#pragma once
/// Built-in register maps of devices, taken from their documentation. Sources and open questions
/// are in drivers/docs/environment.md. Pure functions.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/environment/register_map.hpp"

namespace abbe::drivers {

struct KnownMapOptions {
  /// Serial number as printed on the device. Required by "comet-t7510", whose documentation leaves
  /// an offset of one address open; the other devices have no register for it.
  std::optional<std::uint32_t> serial_number;
  /// "icpdas-zt2005-c8": the temperature channel of each of its inputs; nullopt for an unused
  /// input.
  std::vector<std::optional<std::uint8_t>> inputs;
  std::vector<std::string> input_names;
  /// "icpdas-zt2005-c8", "comet-t7510": Modbus address of the device; over TCP its address on the
  /// gateway's serial line.
  std::uint8_t unit = 1;
};

/// Names of the built-in maps: "vaisala-indigo520-hmp" (probe on port 1, barometer module),
/// "comet-t7510", "icpdas-zt2005-c8".
[[nodiscard]] const std::vector<std::string_view>& known_map_names();
/// Error BadConfiguration: unknown name, or options that the map does not have.
[[nodiscard]] Result<RegisterMap> known_map(std::string_view name, const KnownMapOptions& options);

}  // namespace abbe::drivers
