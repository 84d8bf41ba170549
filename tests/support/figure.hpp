#pragma once
/// Prints one measured figure for scripts/soak: a line that begins with "figure: ".

#include <fmt/format.h>

#include <cstdio>
#include <string_view>

namespace abbe::tests {

/// print_figure("encoder path", "0 lost", "{} lost of {}", lost, scans)
template <class... Values>
void print_figure(std::string_view what, std::string_view asked,
                  fmt::format_string<Values...> measured, Values&&... values) {
  fmt::print("figure: {}: {} (asked: {})\n", what,
             fmt::format(measured, std::forward<Values>(values)...), asked);
  std::fflush(stdout);
}

}  // namespace abbe::tests
