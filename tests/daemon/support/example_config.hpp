#pragma once
/// The abbed.toml that is installed, as a text for tests.

#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace abbe::daemon::example_config {

inline std::string example() {
  std::ifstream in{ABBE_EXAMPLE_CONFIG};
  return {std::istreambuf_iterator<char>{in}, {}};
}

/// With every default written out.
inline std::string uncommented() {
  return std::regex_replace(example(), std::regex{"\n#([a-z_A-Z]+ = )"}, "\n$1");
}

/// With the tables of these names that are there by example only: blocks that begin with "#
/// [NAME]".
inline std::string with_tables(std::string text, const std::vector<std::string>& names) {
  for (const auto& name : names) {
    std::istringstream lines{text};
    text.clear();
    bool in_table = false;
    for (std::string line; std::getline(lines, line);) {
      in_table = line.rfind("# " + name, 0) == 0 || (in_table && line.rfind("# ", 0) == 0);
      text += (in_table ? line.substr(2) : line) + "\n";
    }
  }
  return text;
}

inline std::string with_modbus_and_cmm() {
  return with_tables(example(), {"[[environment]]", "[[thermal]]", "[[sensors.limit]]", "[cmm]"});
}

/// The axes come from one device.
inline std::string with_counter_card_and_probe() {
  const std::string text = example();
  const auto encoder = text.find("\n[encoder]");
  return with_tables(text.substr(0, encoder) + text.substr(text.find("\n\n", encoder)),
                     {"[counter_card]", "[reference]", "[probe]"});
}

}  // namespace abbe::daemon::example_config
