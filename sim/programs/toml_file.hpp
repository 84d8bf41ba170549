#pragma once
/// Reads the TOML files of abbe-sim: makes the reader of their tables known in this namespace, and
/// defines the bounds that examples/sim.toml states.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "abbe/sections/section.hpp"
#include "abbe/sim/error.hpp"

namespace abbe::sim {

using sections::Bounds;
using sections::Hint;
using sections::kMicro;
using sections::kMilli;
using sections::kNano;
using sections::kPlain;
using sections::Need;
using sections::Section;
using sections::Unit;

inline constexpr Unit kMega{1e-6};
inline constexpr Unit kPerMinute{60e3};  ///< unit mm/min, for m/s
inline constexpr Bounds kAnyNumber{-1e12, 1e12};
inline constexpr Bounds kPositiveNumber{1e-12, 1e12};
inline constexpr Bounds kNotNegativeNumber{0.0, 1e12};

/// A TCP or UDP port.
inline bool get_port(Section& section, std::string_view key, std::uint16_t& out) {
  return section.get_integer(key, out, 0, 65535);
}

/// Reads the parts of one file that `reader` knows. Io, or BadInput with every fault at once.
[[nodiscard]] Result<void> read_toml_file(const std::string& file,
                                          const std::function<void(Section)>& reader);

}  // namespace abbe::sim
