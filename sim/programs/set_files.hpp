#pragma once
/// Files of the demo, embedded when abbe-sim is built: machine.toml, path.csv, weak_stiffness.toml.

#include <span>
#include <string_view>

namespace abbe::sim {

struct EmbeddedText {
  std::string_view name;
  std::string_view text;
};

[[nodiscard]] std::span<const EmbeddedText> set_files() noexcept;

}  // namespace abbe::sim
