// Any bytes as a configuration and as a calibrator: faults that name the file, or values. What the
// parser accepts never nests deeper than what was counted before it ran.
//
// libFuzzer: -max_len=4096 -dict=tests/fuzz/toml.dict

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/settings/bounded_toml.hpp"

namespace {

using namespace abbe;

void require(bool holds) {
  if (!holds) std::abort();
}

std::size_t depth_of(const toml::node& node) {
  std::size_t deepest = 0;
  if (const auto* table = node.as_table()) {
    for (const auto& [key, value] : *table) deepest = std::max(deepest, 1 + depth_of(value));
  } else if (const auto* array = node.as_array()) {
    for (const auto& value : *array) deepest = std::max(deepest, 1 + depth_of(value));
  }
  return deepest;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  constexpr std::size_t kDeep = 8;  // small, so that inputs reach it
  // An array of tables is two levels where its name has one part.
  if (const auto table = daemon::parse_toml(text, "fuzz.toml", {.depth = kDeep}))
    require(depth_of(*table) <= 2 * kDeep);
  const auto config = daemon::parse_config(text, "fuzz.toml");
  if (config)
    require(!daemon::machine_hash(*config).empty());
  else
    require(!config.error().text.empty());
  return 0;
}
