#include "abbe/report/html_report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "chart_configuration.hpp"
#include "chart_js.hpp"
#include "markup.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

/// The page is as wide as the printed one, so that charts need no other size in print.
constexpr std::string_view kStyle =
    "@page{size:A4;margin:12mm 10mm}"
    "body{font:14px/1.4 system-ui,'DejaVu Sans',sans-serif;width:190mm;margin:1.5rem "
    "auto;color:#1b1f24}"
    "h1{font-size:1.45rem}h2{font-size:1.1rem;margin:1.6rem 0 .5rem;border-bottom:1px solid "
    "#ccd3da;break-after:avoid}p{margin:.45rem 0}"
    "table{border-collapse:collapse;margin:.6rem 0}th,td{padding:.1rem .9rem .1rem "
    "0;text-align:left;vertical-align:top}"
    "td{font-variant-numeric:tabular-nums;overflow-wrap:anywhere}th{font-weight:600;color:#57606a}"
    ".charts{display:flex;flex-wrap:wrap;gap:3mm 2mm;margin:.6rem 0}"
    ".charts div{width:94mm;height:66mm;break-inside:avoid}.charts .wide{width:190mm;height:62mm}"
    ".maps{width:190mm;display:block;margin:.6rem 0;break-inside:avoid;font-size:11px;fill:#444}"
    ".maps rect{shape-rendering:crispEdges}"
    ".maps .title{font-weight:bold;font-size:12px}.maps .frame{fill:none;stroke:#57606a}"
    "@media print{body{margin:0;print-color-adjust:exact;-webkit-print-color-adjust:exact}}";

/// The value as JSON text for a script element. "<" is escaped: "</" would end the element, "<!--"
/// would change how its end is found.
std::string for_script(const json& value) {
  const std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }

  return out;
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
  canvas(for_script(chart_configuration(chart)), chart.wide);
}

void HtmlReport::chart(const Histogram& histogram) {
  canvas(for_script(chart_configuration(histogram)), histogram.wide);
}

void HtmlReport::chart(const VectorChart& chart) {
  canvas(for_script(chart_configuration(chart)));
}

void HtmlReport::maps(const ValueMaps& maps) {
  body_ += svg(maps);
}

void HtmlReport::drawing(const SpaceDrawing& drawing) {
  body_ += svg(drawing);
}

void HtmlReport::canvas(std::string_view configuration, bool wide) {
  // Consecutive charts share a row.
  constexpr std::string_view kEnd = "</div>\n<!-- charts -->\n";
  if (body_.ends_with(kEnd)) {
    body_.resize(body_.size() - kEnd.size());
  } else {
    body_ += "<div class=\"charts\">\n";
  }
  body_ += fmt::format(
      "<div{3}><canvas "
      "id=\"chart{0}\"></canvas></div>\n<script>show(\"chart{0}\",{1})</script>\n{2}",
      charts_, configuration, kEnd, wide ? " class=\"wide\"" : "");
  ++charts_;
}

std::string HtmlReport::text() const {
  // The curves at the edges of an uncertainty band have no name; the filter removes them from the
  // legend.
  // A canvas with twice the pixels of the screen is sharp in print.
  constexpr std::string_view kShow =
      "if(window.Chart){Chart.defaults.devicePixelRatio=2;Chart.defaults.font.size=11}"
      "function show(id,c){c.options.plugins.legend={labels:{filter:l=>l.text!=='',"
      "usePointStyle:false,boxWidth:22,boxHeight:2}};"
      "new Chart(document.getElementById(id),c)}";
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta "
      "charset=\"utf-8\">\n<title>{0}</title>\n<style>{1}</style>\n"
      "<script>{2}</script>\n<script>{3}</script>\n</head>\n<body>\n<h1>{0}</h1>\n{4}</body>\n</"
      "html>\n",
      title_, kStyle, charts_ > 0 ? chart_js() : std::string_view{}, kShow, body_);
}

}  // namespace abbe::daemon
