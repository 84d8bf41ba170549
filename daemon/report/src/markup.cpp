#include "markup.hpp"

#include <cmath>

namespace abbe::daemon {

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }

  return out;
}

double round_step(double step) {
  if (!(step > 0.0) || !std::isfinite(step)) return 1.0;
  const double decade = std::pow(10.0, std::floor(std::log10(step)));
  constexpr double kRounding = 1.0 + 1e-9;
  for (const double digit : {1.0, 2.0, 2.5, 5.0}) {
    if (digit * decade * kRounding >= step) return digit * decade;
  }

  return 10.0 * decade;
}

}  // namespace abbe::daemon
