#pragma once
/// Functions that the SVG figures share.

#include <string>
#include <string_view>
#include <vector>

namespace abbe::daemon {

/// Multiples of a round step in [first, last], at most `most` of them.
[[nodiscard]] std::vector<double> ticks(double first, double last, int most);

/// A text element; `more`: further attributes, with a leading space.
[[nodiscard]] std::string text_at(double x, double y, std::string_view anchor,
                                  std::string_view text, std::string_view more = "");

/// The text of a tick: "-300", "0", "0.25". Rounding errors are removed.
[[nodiscard]] std::string tick_text(double value);

}  // namespace abbe::daemon
