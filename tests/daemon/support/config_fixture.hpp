#pragma once
/// What the tests of the configuration begin from.

#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {

inline const std::string kMachine = [] {
  auto machine = config_tables::mill();
  machine.y.reference_mm = 10;
  return to_toml(machine);
}();

inline const std::string kCanBus = "[encoder]\ntransport = \"socketcan\"\ninterface = \"can0\"\n";
inline const std::string kNodes =
    R"(nodes = [{axis = "X", node = 1}, {axis = "Y", node = 2}, {axis = "Z", node = 3}]
)";

inline std::vector<std::string> faults_of(const std::string& text) {
  const auto config = parse_config(text, "abbed.toml");
  if (config) return {};
  if (config.error().details.empty()) return {config.error().text};
  return config.error().details;
}

}  // namespace abbe::daemon
