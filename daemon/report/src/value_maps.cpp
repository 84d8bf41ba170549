#include "abbe/report/value_maps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "markup.hpp"
#include "svg_parts.hpp"

namespace abbe::daemon {
namespace {

// Sizes in units of the SVG's view box, which is as wide as the page.
constexpr double kPage = 720.0, kLeft = 62.0, kRight = 76.0, kGap = 14.0;
constexpr double kTop = 40.0, kBottom = 36.0, kBar = 12.0;
constexpr double kFlattest = 0.35, kSteepest = 1.4;  // limits of the ratio height / width of a map

struct Colour {
  double red, green, blue;
};
/// The colour map viridis, whose lightness changes in even steps, from light to dark.
constexpr std::array<Colour, 7> kScale{{{253, 231, 37},
                                        {144, 215, 67},
                                        {53, 183, 121},
                                        {33, 145, 140},
                                        {49, 104, 142},
                                        {68, 57, 131},
                                        {68, 1, 84}}};

/// The colour for `share`, the position on the scale from 0 to 1.
std::string colour_at(double share) {
  const double at = std::clamp(share, 0.0, 1.0) * static_cast<double>(kScale.size() - 1);
  const auto k = std::min(static_cast<std::size_t>(at), kScale.size() - 2);
  const double b = at - static_cast<double>(k);
  const auto mixed = [b](double low, double high) {
    return static_cast<int>(std::lround(low + b * (high - low)));
  };

  return fmt::format("#{:02x}{:02x}{:02x}", mixed(kScale[k].red, kScale[k + 1].red),
                     mixed(kScale[k].green, kScale[k + 1].green),
                     mixed(kScale[k].blue, kScale[k + 1].blue));
}

/// The largest value of all maps; 0 if there is none.
double largest_value(const ValueMaps& maps) {
  double largest = 0.0;
  for (const ValueMap& map : maps.maps) {
    for (const double v : map.values) {
      if (v > largest) largest = v;
    }
  }

  return largest;
}

/// The place of a map on the page, and its scales.
struct Frame {
  double left = 0.0, width = 0.0, height = 0.0;
  const ValueMap& map;

  [[nodiscard]] double x(double value) const {
    const auto& e = map.x_edges;
    return left + width * (value - e.front()) / (e.back() - e.front());
  }
  [[nodiscard]] double y(double value) const {
    const auto& e = map.y_edges;
    return kTop + height * (1.0 - (value - e.front()) / (e.back() - e.front()));
  }
};

std::string rectangle(double left, double top, double width, double height,
                      std::string_view attributes) {
  return fmt::format("<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" {}/>\n",
                     left, top, width, height, attributes);
}

/// The cells that have a value, drawn over hatching. The hatching is one area for all other cells,
/// because Chromium needs minutes to print hundreds of hatched areas.
std::string cells(const Frame& frame, double largest) {
  const ValueMap& map = frame.map;
  const std::size_t columns = map.x_edges.size() - 1;
  const bool has_gaps =
      std::any_of(map.values.begin(), map.values.end(), [](double v) { return std::isnan(v); });
  std::string out;
  if (has_gaps)
    out = rectangle(frame.left, kTop, frame.width, frame.height, "fill=\"url(#hatch)\"");

  for (std::size_t i = 0; i < map.values.size(); ++i) {
    const double v = map.values[i];
    if (std::isnan(v)) continue;
    const std::size_t column = i % columns, row = i / columns;
    const double left = frame.x(map.x_edges[column]), right = frame.x(map.x_edges[column + 1]);
    const double top = frame.y(map.y_edges[row + 1]), bottom = frame.y(map.y_edges[row]);
    out += rectangle(left, top, right - left, bottom - top,
                     fmt::format("fill=\"{}\" data-v=\"{:.6g}\"", colour_at(v / largest), v));
  }
  return out;
}

std::string axes(const Frame& frame, std::string_view x_label, std::string_view y_label) {
  constexpr int kMostX = 3, kMostY = 5;
  const double foot = kTop + frame.height;
  std::string out = fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"frame\"/>\n",
      frame.left, kTop, frame.width, frame.height);
  out += text_at(frame.left + 0.5 * frame.width, kTop - 6.0, "middle", frame.map.title);
  out += text_at(frame.left + 0.5 * frame.width, foot + 28.0, "middle", x_label);
  for (const double at : ticks(frame.map.x_edges.front(), frame.map.x_edges.back(), kMostX))
    out += text_at(frame.x(at), foot + 13.0, "middle", tick_text(at));
  if (y_label.empty()) return out;

  for (const double at : ticks(frame.map.y_edges.front(), frame.map.y_edges.back(), kMostY))
    out += text_at(frame.left - 4.0, frame.y(at) + 4.0, "end", tick_text(at));
  const double middle = kTop + 0.5 * frame.height;
  return out + text_at(12.0, middle, "middle", y_label,
                       fmt::format(" transform=\"rotate(-90 12 {:.1f})\"", middle));
}

std::string scale_bar(double height, double largest, std::string_view label) {
  constexpr int kSteps = 28, kMost = 5;
  const double left = kPage - kRight + kGap;
  std::string out;
  for (int i = 0; i < kSteps; ++i)
    out += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.2f}\" width=\"{}\" height=\"{:.2f}\" fill=\"{}\"/>\n", left,
        kTop + height * (1.0 - (i + 1.0) / kSteps), kBar, height / kSteps + 0.5,
        colour_at((i + 0.5) / kSteps));
  for (const double at : ticks(0.0, largest, kMost))
    out += text_at(left + kBar + 4.0, kTop + height * (1.0 - at / largest) + 4.0, "start",
                   tick_text(at));
  return out + text_at(left, kTop - 6.0, "start", label);
}

/// Ratio height / width of the plane, within the limits of a readable map.
double aspect(const ValueMap& map) {
  const double width = map.x_edges.back() - map.x_edges.front();
  const double height = map.y_edges.back() - map.y_edges.front();
  return std::clamp(height / width, kFlattest, kSteepest);
}

}  // namespace

std::string svg(const ValueMaps& maps) {
  if (maps.maps.empty()) return {};
  const double largest = std::max(largest_value(maps), 1e-12);
  const auto count = static_cast<double>(std::max(maps.maps.size(), maps.least_places));
  const double width = (kPage - kLeft - kRight - (count - 1.0) * kGap) / count;
  const double height = width * aspect(maps.maps.front());
  std::string out = fmt::format(
      "<svg class=\"maps\" viewBox=\"0 0 {} {:.1f}\" role=\"img\">\n"
      "<title>{}</title>\n<defs><pattern id=\"hatch\" width=\"6\" height=\"6\" "
      "patternUnits=\"userSpaceOnUse\"><path d=\"M0 6L6 0\" "
      "stroke=\"#b6bec6\"/></pattern></defs>\n",
      kPage, kTop + height + kBottom, escaped(maps.title));

  out += text_at(0.5 * kPage, 14.0, "middle", maps.title, " class=\"title\"");
  double left = kLeft;
  for (const ValueMap& map : maps.maps) {
    const Frame frame{left, width, height, map};
    out += cells(frame, largest);
    out += axes(frame, maps.x_label, left == kLeft ? maps.y_label : std::string{});
    left += width + kGap;
  }

  return out + scale_bar(height, largest, maps.scale_label) + "</svg>\n";
}

}  // namespace abbe::daemon
