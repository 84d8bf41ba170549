#include "chart_configuration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "line_colours.hpp"
#include "markup.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

/// Dashes and dots distinguish the curves of a print without colours.
constexpr std::array<std::pair<int, int>, 3> kDashes{{{0, 0}, {7, 3}, {2, 3}}};
constexpr std::array<std::string_view, 3> kDots{"circle", "triangle", "rect"};

json points(const std::vector<double>& x, const std::vector<double>& y) {
  json list = json::array();
  for (std::size_t i = 0; i < x.size(); ++i) list.push_back({{"x", x[i]}, {"y", y[i]}});
  return list;
}

/// One edge of a band, which is filled up to the dataset before it if `filled`. It has no name, so
/// that the legend does not show it.
json edge(const std::vector<double>& x, const std::vector<double>& y, bool filled,
          std::size_t number) {
  return {{"label", ""},
          {"data", points(x, y)},
          {"showLine", true},
          {"borderWidth", 0},
          {"pointRadius", 0},
          {"backgroundColor", fmt::format("{}38", line_colour(number))},
          {"fill", filled ? json("-1") : json(false)}};
}

std::vector<double> shifted(const Curve& curve, double factor) {
  std::vector<double> y = curve.y;
  for (std::size_t i = 0; i < y.size(); ++i) y[i] += factor * curve.u[i];
  return y;
}

/// Adds the two edges of the band of a curve; nothing without a band.
void add_band(json& datasets, const Curve& curve, std::size_t number) {
  const std::size_t n = curve.x.size();
  if (n == 0) return;
  if (curve.u.size() == n) {
    datasets.push_back(edge(curve.x, shifted(curve, -2.0), false, number));
    datasets.push_back(edge(curve.x, shifted(curve, 2.0), true, number));
  } else if (curve.low.size() == n && curve.high.size() == n) {
    datasets.push_back(edge(curve.x, curve.low, false, number));
    datasets.push_back(edge(curve.x, curve.high, true, number));
  }
}

json dashes(std::size_t number) {
  const auto [drawn, gap] = kDashes[number % kDashes.size()];
  return gap > 0 ? json::array({drawn, gap}) : json::array();
}

json line(const Curve& curve, std::size_t number) {
  constexpr double kDot = 2.5;
  json radii = json::array();
  for (std::size_t i = 0; i < curve.x.size(); ++i)
    radii.push_back(curve.dot_every > 0 && i % curve.dot_every == 0 ? kDot : 0.0);
  return {{"label", curve.name},
          {"data", points(curve.x, curve.y)},
          {"showLine", true},
          {"borderWidth", 1.5},
          {"borderDash", dashes(number)},
          {"pointStyle", kDots[number % kDots.size()]},
          {"pointRadius", std::move(radii)},
          {"borderColor", line_colour(number)},
          {"backgroundColor", line_colour(number)}};
}

json axis(std::string_view label) {
  return {{"type", "linear"}, {"title", {{"display", true}, {"text", label}}}};
}

json options(std::string_view title, json x, json y) {
  y["grace"] = "4%";  // free space above and below the values
  return {{"animation", false},
          {"maintainAspectRatio", false},
          {"plugins", {{"title", {{"display", true}, {"text", title}}}}},
          {"scales", {{"x", std::move(x)}, {"y", std::move(y)}}}};
}

json scatter(json datasets, json options) {
  return {{"type", "scatter"},
          {"data", {{"datasets", std::move(datasets)}}},
          {"options", std::move(options)}};
}

/// Smallest and largest x of all curves; nullopt without points.
std::optional<std::pair<double, double>> extent(const std::vector<Curve>& curves) {
  std::optional<std::pair<double, double>> found;
  for (const Curve& curve : curves) {
    for (const double x : curve.x) {
      if (!found) found = {x, x};
      found = {std::min(found->first, x), std::max(found->second, x)};
    }
  }

  return found;
}

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

/// The outline of the bars of one series.
Curve outline(const Histogram::Series& series, const Bins& bins) {
  std::vector<std::size_t> counts(bins.count, 0);
  for (const double v : series.values) ++counts[bins.of(v)];
  Curve out{.name = series.name, .x = {bins.first}, .y = {0.0}, .dot_every = 0};

  for (std::size_t b = 0; b < bins.count; ++b) {
    const auto count = static_cast<double>(counts[b]);
    out.x.insert(out.x.end(), {bins.edge(b), bins.edge(b + 1)});
    out.y.insert(out.y.end(), {count, count});
  }

  out.x.push_back(bins.edge(bins.count));
  out.y.push_back(0.0);
  return out;
}

/// Expected counts n (Phi(b / sd) - Phi(a / sd)) of the intervals [a, b], at their middles.
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

json chart_configuration(const LineChart& chart) {
  json datasets = json::array();
  for (std::size_t i = 0; i < chart.curves.size(); ++i) {
    add_band(datasets, chart.curves[i], i);
    datasets.push_back(line(chart.curves[i], i));
  }

  json x = axis(chart.x_label);
  if (const auto range = extent(chart.curves); range && range->second > range->first) {
    x["min"] = range->first;
    x["max"] = range->second;
  }
  return scatter(std::move(datasets), options(chart.title, std::move(x), axis(chart.y_label)));
}

json chart_configuration(const Histogram& histogram) {
  const Bins bins = bins_of(histogram);
  json datasets = json::array();
  if (histogram.normal_sd && !histogram.series.empty())
    datasets.push_back(
        line(normal_curve(histogram.series.front().values.size(), *histogram.normal_sd, bins), 1));

  for (std::size_t i = 0; i < histogram.series.size(); ++i) {
    json bars = line(outline(histogram.series[i], bins), 2 * i);
    bars["borderDash"] = json::array();
    bars["borderWidth"] = 0.75;
    bars["backgroundColor"] = fmt::format("{}66", line_colour(2 * i));
    bars["fill"] = "origin";
    datasets.push_back(std::move(bars));
  }

  json x = axis(histogram.x_label), y = axis("count");
  y["min"] = 0;
  x["min"] = bins.first;
  x["max"] = bins.edge(bins.count);
  return scatter(std::move(datasets), options(histogram.title, std::move(x), std::move(y)));
}

json chart_configuration(const VectorChart& chart) {
  // All vectors are drawn as one line with a gap after each vector; only the origins of the vectors
  // have a dot.
  const json gap{{"x", nullptr}, {"y", nullptr}};
  json line = json::array(), dots = json::array();
  for (const auto& a : chart.arrows) {
    line.push_back({{"x", a.x}, {"y", a.y}});
    line.push_back(
        {{"x", a.x + chart.magnification * a.dx}, {"y", a.y + chart.magnification * a.dy}});
    line.push_back(gap);
    for (const double radius : {2.0, 0.0, 0.0}) dots.push_back(radius);
  }

  const json dataset{{"label", chart.name},
                     {"data", line},
                     {"showLine", true},
                     {"spanGaps", false},
                     {"borderWidth", 1.5},
                     {"pointRadius", dots},
                     {"borderColor", line_colour(0)},
                     {"backgroundColor", line_colour(0)}};
  return scatter(json::array({dataset}),
                 options(chart.title, axis(chart.x_label), axis(chart.y_label)));
}

}  // namespace abbe::daemon
