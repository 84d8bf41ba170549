#pragma once
/// The register maps of devices whose documentation was read. Facts and their doubts are in
/// drivers/docs/environment.md. Pure.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/environment/register_map.hpp"

namespace abbe::drivers {

struct KnownMapOptions {
  /// Serial number as printed on the device; "comet-t7510" needs it (its documentation is ambiguous
  /// by one address), the others have no register for it.
  std::optional<std::uint32_t> serial_number;
  /// "icpdas-zt2005-c8": the temperature channel of each of its inputs, none for one that is not
  /// used.
  std::vector<std::optional<std::uint8_t>> inputs;
  std::vector<std::string> input_names;
  /// "icpdas-zt2005-c8", "comet-t7510": the address of the device, with TCP the one of the
  /// gateway's line.
  std::uint8_t unit = 1;
};

/// "vaisala-indigo520-hmp": probe on port 1, barometer module; "comet-t7510"; "icpdas-zt2005-c8".
[[nodiscard]] const std::vector<std::string_view>& known_map_names();
/// BadConfiguration: no such map, or options that are not for it.
[[nodiscard]] Result<RegisterMap> known_map(std::string_view name, const KnownMapOptions& options);

}  // namespace abbe::drivers
