#pragma once
/// Escapes text for HTML and SVG, and computes round numbers for axes.

#include <string>
#include <string_view>

namespace abbe::daemon {

/// `text`, escaped for text and for attributes in double quotes.
[[nodiscard]] std::string escaped(std::string_view text);

/// The smallest of 1, 2, 2.5 and 5 times a power of ten that is not smaller than `step`; 1 unless
/// `step` is positive and finite.
[[nodiscard]] double round_step(double step);

}  // namespace abbe::daemon
