#pragma once
/// Parts that the SVG figures have in common.

#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

/// Multiples of a round step in [first, last], at most `most` of them.
[[nodiscard]] std::vector<double> ticks(double first, double last, int most);

/// A text element; `more`: further attributes, with a leading space.
[[nodiscard]] std::string text_at(double x, double y, std::string_view anchor,
                                  std::string_view text, std::string_view more = "");

/// "-300", "0", "0.25"; a rounding error does not show.
[[nodiscard]] std::string tick_text(double value);

}  // namespace abbe::daemon
