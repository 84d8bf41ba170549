#include "svg_parts.hpp"

#include <fmt/format.h>

#include <cmath>

#include "markup.hpp"

namespace abbe::daemon {

std::vector<double> ticks(double first, double last, int most) {
  const double step = round_step((last - first) / most);
  const double slack = 1e-6 * step;
  std::vector<double> at;
  for (double k = std::ceil((first - slack) / step); k * step <= last + slack; k += 1.0)
    at.push_back(k * step + 0.0);
  return at;
}

std::string text_at(double x, double y, std::string_view anchor, std::string_view text,
                    std::string_view more) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\"{}>{}</text>", x, y, anchor,
                     more, escaped(text));
}

std::string tick_text(double value) {
  return fmt::format("{:.4g}", std::abs(value) < 1e-12 ? 0.0 : value);
}

}  // namespace abbe::daemon
