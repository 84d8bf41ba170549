#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "abbe/report/line_plot.hpp"
#include "markup.hpp"

namespace abbe::daemon {
namespace {

struct Bins {
  double first = 0.0, width = 1.0;
  std::size_t count = 1;

  [[nodiscard]] std::size_t of(double value) const {
    const double at = std::floor((value - first) / width);
    return static_cast<std::size_t>(std::clamp(at, 0.0, static_cast<double>(count - 1)));
  }
  [[nodiscard]] double edge(std::size_t i) const { return first + static_cast<double>(i) * width; }
};

Bins bins_of(const Histogram& histogram) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const auto& series : histogram.series) {
    for (const double v : series.values) {
      low = std::min(low, v);
      high = std::max(high, v);
    }
  }
  if (!std::isfinite(low) || !std::isfinite(high)) return {};

  const double width = round_step((high - low) / static_cast<double>(histogram.bins));
  const double first = std::floor(low / width) * width;
  return {first, width, 1 + static_cast<std::size_t>(std::floor((high - first) / width))};
}

/// The outline of the bars of one series, as the upper edge of a band that begins at 0.
Curve outline(const Histogram::Series& series, const Bins& bins) {
  std::vector<double> counts(bins.count, 0.0);
  for (const double v : series.values)
    if (std::isfinite(v)) counts[bins.of(v)] += 1.0;
  Curve out{.name = series.name, .x = {bins.first}, .y = {0.0}, .dot_every = 0};

  for (std::size_t b = 0; b < bins.count; ++b) {
    out.x.insert(out.x.end(), {bins.edge(b), bins.edge(b + 1)});
    out.y.insert(out.y.end(), {counts[b], counts[b]});
  }
  out.x.push_back(bins.edge(bins.count));
  out.y.push_back(0.0);
  out.low.assign(out.y.size(), 0.0);
  out.high = out.y;
  return out;
}

/// Expected counts n (Phi(b / sd) - Phi(a / sd)) of the intervals [a, b], drawn at their middles.
Curve normal_curve(std::size_t n, double sd, const Bins& bins) {
  const auto below = [sd](double x) { return 0.5 * std::erfc(-x / (sd * std::numbers::sqrt2)); };
  Curve out{.name = "normal distribution", .x = {}, .y = {}, .dot_every = 0};
  for (std::size_t b = 0; b < bins.count; ++b) {
    out.x.push_back(0.5 * (bins.edge(b) + bins.edge(b + 1)));
    out.y.push_back(static_cast<double>(n) * (below(bins.edge(b + 1)) - below(bins.edge(b))));
  }

  return out;
}

}  // namespace

LineChart line_chart(const Histogram& histogram) {
  const Bins bins = bins_of(histogram);
  LineChart chart{.title = histogram.title,
                  .x_label = histogram.x_label,
                  .y_label = "count",
                  .wide = histogram.wide};
  for (const Histogram::Series& series : histogram.series)
    chart.curves.push_back(outline(series, bins));
  if (histogram.normal_sd && !histogram.series.empty())
    chart.curves.push_back(
        normal_curve(histogram.series.front().values.size(), *histogram.normal_sd, bins));
  return chart;
}

LineChart line_chart(const VectorChart& chart) {
  constexpr double kGap = std::numeric_limits<double>::quiet_NaN();
  Curve curve{.name = chart.name, .x = {}, .y = {}, .dot_every = 3};  // a dot at each origin
  for (const VectorChart::Arrow& a : chart.arrows) {
    curve.x.insert(curve.x.end(), {a.x, a.x + chart.magnification * a.dx, kGap});
    curve.y.insert(curve.y.end(), {a.y, a.y + chart.magnification * a.dy, kGap});
  }
  return {.title = chart.title,
          .x_label = chart.x_label,
          .y_label = chart.y_label,
          .curves = {std::move(curve)}};
}

}  // namespace abbe::daemon
