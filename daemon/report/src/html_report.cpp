#include "abbe/report/html_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "chart_js.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

constexpr std::string_view kStyle =
    "body{font:15px/1.45 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 "
    "1rem;color:#1b1f24}"
    "h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem;border-bottom:1px solid #ccd3da}"
    "table{border-collapse:collapse;margin:.6rem 0}th,td{padding:.15rem .9rem .15rem "
    "0;text-align:left}"
    "td{font-variant-numeric:tabular-nums}th{font-weight:600;color:#57606a}"
    ".charts{display:flex;flex-wrap:wrap;gap:1rem}.charts div{width:33rem;height:19rem}"
    "@media print{.charts div{break-inside:avoid}}";

/// Colours that people with colour vision deficiency can distinguish [Okabe, Ito 2008].
constexpr std::array<std::string_view, 6> kColours{"#0072b2", "#d55e00", "#009e73",
                                                   "#cc79a7", "#e69f00", "#56b4e9"};

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
      default:
        out += c;
    }
  }

  return out;
}

/// The value as JSON text for a script element. "</" is escaped, because it would end the element.
std::string for_script(const json& value) {
  std::string text = value.dump();
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return text;
}

std::string_view colour(std::size_t i) {
  return kColours[i % kColours.size()];
}

json points(const std::vector<double>& x, const std::vector<double>& y) {
  json list = json::array();
  for (std::size_t i = 0; i < x.size(); ++i) list.push_back({{"x", x[i]}, {"y", y[i]}});
  return list;
}

/// One edge of the uncertainty band: the curve plus `factor` standard uncertainties.
json edge(const Curve& curve, double factor, std::size_t number) {
  std::vector<double> y = curve.y;
  for (std::size_t i = 0; i < y.size(); ++i) y[i] += factor * curve.u[i];
  return {{"label", ""},
          {"data", points(curve.x, y)},
          {"showLine", true},
          {"borderWidth", 0},
          {"pointRadius", 0},
          {"backgroundColor", fmt::format("{}33", colour(number))},
          {"fill", factor > 0 ? json("-1") : json(false)}};
}

json axis(std::string_view label) {
  return {{"type", "linear"}, {"title", {{"display", true}, {"text", label}}}};
}

json options(std::string_view title, json x, json y) {
  return {{"animation", false},
          {"maintainAspectRatio", false},
          {"plugins", {{"title", {{"display", true}, {"text", title}}}}},
          {"scales", {{"x", std::move(x)}, {"y", std::move(y)}}}};
}

struct Bins {
  double first = 0.0, width = 1.0;
  std::size_t count = 1;

  [[nodiscard]] std::size_t of(double value) const {
    return std::min(count - 1, static_cast<std::size_t>((value - first) / width));
  }
};

Bins bins_of(const Histogram& histogram) {
  double low = 0.0, high = 0.0;
  bool any = false;
  for (const auto& series : histogram.series) {
    for (const double v : series.values) {
      low = any ? std::min(low, v) : v;
      high = any ? std::max(high, v) : v;
      any = true;
    }
  }
  if (!(high > low)) return {low, 1.0, 1};
  return {low, (high - low) / static_cast<double>(histogram.bins), histogram.bins};
}

}  // namespace

HtmlReport::HtmlReport(std::string_view title) : title_(escaped(title)) {}

void HtmlReport::heading(std::string_view text) {
  body_ += fmt::format("<h2>{}</h2>\n", escaped(text));
}

void HtmlReport::paragraph(std::string_view text) {
  body_ += fmt::format("<p>{}</p>\n", escaped(text));
}

void HtmlReport::facts(const std::vector<std::pair<std::string, std::string>>& facts) {
  body_ += "<table>\n";
  for (const auto& [what, value] : facts)
    body_ += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(what), escaped(value));
  body_ += "</table>\n";
}

void HtmlReport::table(const std::vector<std::string>& columns,
                       const std::vector<std::vector<std::string>>& rows) {
  body_ += "<table>\n<tr>";
  for (const auto& column : columns) body_ += fmt::format("<th>{}</th>", escaped(column));
  body_ += "</tr>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const auto& cell : row) body_ += fmt::format("<td>{}</td>", escaped(cell));
    body_ += "</tr>\n";
  }
  body_ += "</table>\n";
}

void HtmlReport::chart(const LineChart& chart) {
  json datasets = json::array();
  for (std::size_t i = 0; i < chart.curves.size(); ++i) {
    const Curve& curve = chart.curves[i];
    if (curve.u.size() == curve.y.size() && !curve.u.empty()) {
      datasets.push_back(edge(curve, -2.0, i));
      datasets.push_back(edge(curve, 2.0, i));
    }
    datasets.push_back({{"label", curve.name},
                        {"data", points(curve.x, curve.y)},
                        {"showLine", true},
                        {"borderWidth", 2},
                        {"pointRadius", 2},
                        {"borderColor", colour(i)},
                        {"backgroundColor", colour(i)}});
  }

  canvas(for_script({{"type", "scatter"},
                     {"data", {{"datasets", datasets}}},
                     {"options", options(chart.title, axis(chart.x_label), axis(chart.y_label))}}));
}

void HtmlReport::chart(const Histogram& histogram) {
  const Bins bins = bins_of(histogram);
  json labels = json::array(), datasets = json::array();
  for (std::size_t b = 0; b < bins.count; ++b)
    labels.push_back(
        fmt::format("{:.3g}", bins.first + (static_cast<double>(b) + 0.5) * bins.width));

  for (std::size_t i = 0; i < histogram.series.size(); ++i) {
    std::vector<std::size_t> counts(bins.count, 0);
    for (const double v : histogram.series[i].values) ++counts[bins.of(v)];
    datasets.push_back({{"label", histogram.series[i].name},
                        {"data", counts},
                        {"backgroundColor", fmt::format("{}aa", colour(i))},
                        {"grouped", false},
                        {"barPercentage", 1.0},
                        {"categoryPercentage", 1.0}});
  }

  canvas(
      for_script({{"type", "bar"},
                  {"data", {{"labels", labels}, {"datasets", datasets}}},
                  {"options", options(histogram.title,
                                      {{"title", {{"display", true}, {"text", histogram.x_label}}}},
                                      axis("count"))}}));
}

void HtmlReport::chart(const VectorChart& chart) {
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

  const json dataset{{"label", chart.name},      {"data", line},
                     {"showLine", true},         {"spanGaps", false},
                     {"borderWidth", 1.5},       {"pointRadius", dots},
                     {"borderColor", colour(0)}, {"backgroundColor", colour(0)}};
  canvas(for_script({{"type", "scatter"},
                     {"data", {{"datasets", json::array({dataset})}}},
                     {"options", options(chart.title, axis(chart.x_label), axis(chart.y_label))}}));
}

void HtmlReport::canvas(std::string_view configuration) {
  // Consecutive charts share a row.
  constexpr std::string_view kEnd = "</div>\n<!-- charts -->\n";
  if (body_.ends_with(kEnd)) {
    body_.resize(body_.size() - kEnd.size());
  } else {
    body_ += "<div class=\"charts\">\n";
  }
  body_ += fmt::format(
      "<div><canvas id=\"chart{0}\"></canvas></div>\n<script>show(\"chart{0}\",{1})</script>\n{2}",
      charts_, configuration, kEnd);
  ++charts_;
}

std::string HtmlReport::text() const {
  // The curves at the edges of an uncertainty band have no name; the filter removes them from the
  // legend.
  constexpr std::string_view kShow =
      "function show(id,c){c.options.plugins.legend={labels:{filter:l=>l.text!==''}};"
      "new Chart(document.getElementById(id),c)}";
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta "
      "charset=\"utf-8\">\n<title>{0}</title>\n<style>{1}</style>\n"
      "<script>{2}</script>\n<script>{3}</script>\n</head>\n<body>\n<h1>{0}</h1>\n{4}</body>\n</"
      "html>\n",
      title_, kStyle, charts_ > 0 ? chart_js() : std::string_view{}, kShow, body_);
}

}  // namespace abbe::daemon
