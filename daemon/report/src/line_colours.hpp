#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace abbe::daemon {

/// Colours that people with colour vision deficiency can distinguish [Okabe, Ito 2008].
inline constexpr std::array<std::string_view, 6> kLineColours{"#0072b2", "#d55e00", "#009e73",
                                                              "#cc79a7", "#e69f00", "#56b4e9"};

/// The colour of line number i; the colours repeat.
[[nodiscard]] constexpr std::string_view line_colour(std::size_t i) {
  return kLineColours[i % kLineColours.size()];
}

}  // namespace abbe::daemon
