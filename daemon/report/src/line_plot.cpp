#include "abbe/report/line_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string_view>

#include "line_colours.hpp"
#include "markup.hpp"
#include "svg_parts.hpp"

namespace abbe::daemon {
namespace {

// In units of the SVG's view box.
constexpr double kHalfWidth = 356.0, kWholeWidth = 720.0;
constexpr double kPlotLeft = 50.0, kPlotRight = 12.0, kHead = 22.0, kLegendRow = 14.0;
constexpr double kPanel = 150.0, kSecondPanel = 52.0, kBetween = 22.0, kFoot = 34.0;

struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void add(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  /// With space around the values; a range of length 1 if there are none, or only one.
  [[nodiscard]] Extent padded(double share) const {
    if (!(low <= high)) return {0.0, 1.0};
    const double size = high > low ? high - low : std::max(1.0, std::abs(low));
    return {low - share * size, high + share * size};
  }
};

bool has_u(const Curve& curve) {
  return !curve.u.empty() && curve.u.size() == curve.x.size();
}

bool has_range(const Curve& curve) {
  return !has_u(curve) && !curve.low.empty() && curve.low.size() == curve.x.size() &&
         curve.high.size() == curve.x.size();
}

/// Lower and upper edge of the band at point i; the curve itself without a band.
Extent band_at(const Curve& curve, std::size_t i) {
  if (has_u(curve)) return {curve.y[i] - 2.0 * curve.u[i], curve.y[i] + 2.0 * curve.u[i]};
  if (has_range(curve)) return {curve.low[i], curve.high[i]};
  return {curve.y[i], curve.y[i]};
}

/// A panel of the figure with its scales.
struct PlotPanel {
  double left, top, width, height;
  Extent x, y;

  [[nodiscard]] double at_x(double value) const {
    return left + width * (value - x.low) / (x.high - x.low);
  }
  [[nodiscard]] double at_y(double value) const {
    return top + height * (1.0 - (value - y.low) / (y.high - y.low));
  }
};

std::string band_of(const PlotPanel& panel, const Curve& curve, std::size_t number) {
  if (!has_u(curve) && !has_range(curve)) return {};
  std::string upper, lower;
  for (std::size_t i = 0; i < curve.x.size(); ++i) {
    const Extent band = band_at(curve, i);
    if (!std::isfinite(band.low) || !std::isfinite(band.high)) continue;
    const double x = panel.at_x(curve.x[i]);
    upper += fmt::format("{:.2f},{:.2f} ", x, panel.at_y(band.high));
    lower = fmt::format("{:.2f},{:.2f} ", x, panel.at_y(band.low)) + lower;
  }
  return fmt::format("<polygon class=\"band\" points=\"{}{}\" fill=\"{}\"/>\n", upper, lower,
                     line_colour(number));
}

constexpr std::array<std::string_view, 3> kStrokes{"", " stroke-dasharray=\"7 3\"",
                                                   " stroke-dasharray=\"2 3\""};

std::string stroke_of(std::size_t number) {
  return fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"{}", line_colour(number),
                     kStrokes.at(number % kStrokes.size()));
}

/// "1.5 2 -" for numbers and points that are not finite.
std::string data_of(const std::vector<double>& values) {
  std::string out;
  for (const double v : values) {
    if (!out.empty()) out += ' ';
    out += std::isfinite(v) ? fmt::format("{:.9g}", v) : "-";
  }
  return out;
}

/// Begins the group of a curve, which carries the numbers that the curve shows.
std::string begin_curve(const Curve& curve) {
  return fmt::format("<g class=\"curve\" data-name=\"{}\" data-x=\"{}\" data-y=\"{}\"{}>\n",
                     escaped(curve.name), data_of(curve.x), data_of(curve.y),
                     has_u(curve) ? fmt::format(" data-u=\"{}\"", data_of(curve.u)) : "");
}

/// The line through the points (x, y), in pieces between points that are not finite.
std::string line_of(const PlotPanel& panel, const std::vector<double>& x,
                    const std::vector<double>& y, std::size_t number) {
  std::string path;
  bool begins = true;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const bool finite = std::isfinite(x[i]) && std::isfinite(y[i]);
    if (finite)
      path +=
          fmt::format("{}{:.2f} {:.2f}", begins ? 'M' : 'L', panel.at_x(x[i]), panel.at_y(y[i]));
    begins = !finite;
  }
  return fmt::format("<path d=\"{}\" {}/>\n", path, stroke_of(number));
}

std::string dots_of(const PlotPanel& panel, const Curve& curve, std::size_t number) {
  std::string out;
  if (curve.dot_every == 0) return out;
  for (std::size_t i = 0; i < curve.x.size(); i += curve.dot_every)
    if (std::isfinite(curve.y[i]))
      out += fmt::format("<circle cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"2\" fill=\"{}\"/>\n",
                         panel.at_x(curve.x[i]), panel.at_y(curve.y[i]), line_colour(number));
  return out;
}

/// Frame, ticks and grid of a panel; the numbers of x only if `with_x`.
std::string frame_of(const PlotPanel& panel, std::string_view y_label, int most_y, bool with_x) {
  constexpr int kMostX = 7;
  const double foot = panel.top + panel.height;
  std::string out;
  for (const double at : ticks(panel.y.low, panel.y.high, most_y)) {
    const double y = panel.at_y(at);
    out += fmt::format("<path class=\"grid\" d=\"M{:.1f} {:.2f}h{:.1f}\"/>", panel.left, y,
                       panel.width);
    out += text_at(panel.left - 4.0, y + 3.5, "end", tick_text(at));
  }
  for (const double at : ticks(panel.x.low, panel.x.high, kMostX)) {
    const double x = panel.at_x(at);
    out += fmt::format("<path class=\"grid\" d=\"M{:.2f} {:.1f}v{:.1f}\"/>", x, panel.top,
                       panel.height);
    if (with_x) out += text_at(x, foot + 12.0, "middle", tick_text(at));
  }
  out += fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" class=\"frame\"/>\n",
      panel.left, panel.top, panel.width, panel.height);
  const double middle = panel.top + 0.5 * panel.height;
  return out + text_at(11.0, middle, "middle", y_label,
                       fmt::format(" transform=\"rotate(-90 11 {:.1f})\"", middle));
}

std::size_t legend_columns(const LineChart& chart) {
  return chart.wide ? 4 : 2;
}

double legend_height(const LineChart& chart) {
  const std::size_t columns = legend_columns(chart);
  return kLegendRow * static_cast<double>((chart.curves.size() + columns - 1) / columns);
}

std::string legend_of(const LineChart& chart, double width) {
  const std::size_t columns = legend_columns(chart);
  const double step = (width - kPlotLeft - kPlotRight) / static_cast<double>(columns);
  std::string out;
  for (std::size_t i = 0; i < chart.curves.size(); ++i) {
    const double x = kPlotLeft + step * static_cast<double>(i % columns);
    const double y = kHead + kLegendRow * static_cast<double>(i / columns) + 6.0;
    out += fmt::format("<path d=\"M{:.1f} {:.1f}h20\" {}/>", x, y, stroke_of(i));
    out += text_at(x + 25.0, y + 3.5, "start", chart.curves[i].name);
  }
  return out + "\n";
}

/// Largest 2 u of all curves; 0 if a curve has no u.
double widest_band(const LineChart& chart) {
  double widest = 0.0;
  for (const Curve& curve : chart.curves) {
    if (!has_u(curve)) return 0.0;
    for (const double u : curve.u)
      if (std::isfinite(u)) widest = std::max(widest, 2.0 * u);
  }
  return widest;
}

PlotPanel main_panel(const LineChart& chart, double width) {
  Extent x, y;
  for (const Curve& curve : chart.curves) {
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      const Extent band = band_at(curve, i);
      x.add(curve.x[i]);
      y.add(band.low);
      y.add(band.high);
    }
  }
  return {kPlotLeft,
          kHead + legend_height(chart),
          width - kPlotLeft - kPlotRight,
          kPanel,
          x.padded(0.01),
          y.padded(0.05)};
}

}  // namespace

std::string svg(const LineChart& chart) {
  const double width = chart.wide ? kWholeWidth : kHalfWidth;
  const PlotPanel panel = main_panel(chart, width);
  const double widest = widest_band(chart);
  const bool second = widest > 0.0 && widest < kVisibleBand * (panel.y.high - panel.y.low);
  const double foot = panel.top + kPanel + (second ? kBetween + kSecondPanel : 0.0);

  std::string out = fmt::format(
      "<svg class=\"plot{}\" viewBox=\"0 0 {} {:.1f}\" role=\"img\">\n<title>{}</title>\n",
      chart.wide ? " wide" : "", width, foot + kFoot, escaped(chart.title));
  out += text_at(0.5 * width, 13.0, "middle", chart.title, " class=\"title\"");
  out += legend_of(chart, width) + frame_of(panel, chart.y_label, 6, !second);
  for (std::size_t i = 0; i < chart.curves.size(); ++i) out += band_of(panel, chart.curves[i], i);
  for (std::size_t i = 0; i < chart.curves.size(); ++i)
    out += begin_curve(chart.curves[i]) + line_of(panel, chart.curves[i].x, chart.curves[i].y, i) +
           dots_of(panel, chart.curves[i], i) + "</g>\n";

  if (second) {
    const PlotPanel below{panel.left,  panel.top + kPanel + kBetween,
                          panel.width, kSecondPanel,
                          panel.x,     {0.0, 1.1 * widest}};
    out += text_at(panel.left, below.top - 5.0, "start", "U = 2 u of these curves");
    out += frame_of(below, "U", 3, true);
    for (std::size_t i = 0; i < chart.curves.size(); ++i) {
      std::vector<double> U = chart.curves[i].u;
      for (double& value : U) value *= 2.0;
      out += line_of(below, chart.curves[i].x, U, i);
    }
  }
  out += text_at(panel.left + 0.5 * panel.width, foot + 27.0, "middle", chart.x_label);
  return out + "</svg>\n";
}

}  // namespace abbe::daemon
