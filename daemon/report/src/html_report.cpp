#include "abbe/report/html_report.hpp"

#include <fmt/format.h>

#include <array>

#include "abbe/report/line_plot.hpp"
#include "markup.hpp"

namespace abbe::daemon {
namespace {

/// The page is as wide as a printed page, so that charts have the same size in print.
constexpr std::string_view kStyle =
    "@page{size:A4;margin:12mm 10mm 15mm;@bottom-right{content:'page 'counter(page)' of '"
    "counter(pages);font:8.5pt sans-serif;width:30mm}}"
    "body{font:14px/1.4 system-ui,'DejaVu Sans',sans-serif;width:190mm;margin:1.5rem "
    "auto;color:#1b1f24}"
    "h1{font-size:1.45rem}h2{font-size:1.1rem;margin:1.6rem 0 .5rem;border-bottom:1px solid "
    "#ccd3da;break-after:avoid}p{margin:.45rem 0}h2+p{break-after:avoid}"
    "table{border-collapse:collapse;margin:.6rem 0}th,td{padding:.1rem .9rem .1rem "
    "0;text-align:left;vertical-align:top}"
    "td{font-variant-numeric:tabular-nums}td.long{overflow-wrap:anywhere}th{font-weight:600;color:#"
    "57606a}"
    ".maps{width:190mm;display:block;margin:.6rem 0;break-inside:avoid;font-size:11px;fill:#444}"
    ".maps rect{shape-rendering:crispEdges}"
    ".maps .title{font-weight:bold;font-size:12px}.maps .frame{fill:none;stroke:#57606a}"
    ".plots{display:flex;flex-wrap:wrap;gap:2mm}.plot{width:94mm;display:block;break-inside:avoid;"
    "font-size:11px;fill:#444}.plot.wide{width:190mm}.plot .title{font-weight:bold;font-size:12px}"
    ".plot .frame{fill:none;stroke:#57606a}.plot .grid{stroke:#e1e5ea;fill:none}"
    ".plot .band{fill-opacity:.22;stroke:none}.page{break-before:page}"
    ".columns{column-count:2;column-gap:6mm;font-size:11.5px;line-height:1.3}.columns "
    "h2{margin-top:"
    "0}.columns table{break-inside:avoid;margin:.3rem 0 .8rem}.columns td,.columns "
    "th{padding-right:"
    ".5rem}.columns p{break-after:avoid}"
    ".signal{display:flex;align-items:center;gap:4mm;font-size:1.1rem;font-weight:600}"
    ".signal svg{width:9mm;height:24mm;flex:none}ul{margin:.3rem 0;padding-left:1.2rem}"
    ".front{font-size:12px;line-height:1.3}.front .columns{margin:.2rem 0}.front h2{margin:.6rem 0 "
    ".2rem}.front p{margin:.2rem 0}.front table{margin:.2rem 0}.front .maps{margin:.3rem 0}.front "
    ".signal{font-size:1rem}.front .signal svg{width:6mm;height:16mm}"
    ".front .columns th{white-space:nowrap}"
    ".maps.drawing{width:120mm}"
    // The print style keeps the report of a model to at most 8 pages.
    "@media print{h1{margin:.3rem 0}h2{margin:.7rem 0 .2rem;font-size:1rem}p{margin:.2rem 0}"
    "table{margin:.25rem 0}.maps{width:140mm;margin:.3rem 0}.front .maps{width:190mm}"
    ".plot{width:72mm}.plot.wide{width:146mm}.maps.drawing{width:80mm}"
    ".columns{font-size:10.5px}body{font-size:11.5px;margin:0;print-color-adjust:exact;"
    "-webkit-print-color-adjust:exact}}";

constexpr std::string_view kFooter =
    "@page{{@bottom-left{{content:'{}';font:8.5pt sans-serif;white-space:nowrap}}}}";

/// The text as a CSS string: all characters except letters, digits and spaces are written by their
/// number. Bytes beyond ASCII are not changed, because they cannot end a string.
std::string in_style_sheet(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    const bool is_plain = is_letter || (c >= '0' && c <= '9') || c == ' ' || c < 0;
    out += is_plain ? std::string(1, c) : fmt::format("\\{:06x}", static_cast<unsigned>(c));
  }
  return out;
}

/// A cell of a table. A long word, such as a hash, may be broken into lines; a number is never
/// broken.
std::string cell(std::string_view text) {
  constexpr std::size_t kLongestWord = 40;
  std::size_t length = 0;
  bool is_long = false;
  for (const char letter : text) {
    length = letter == ' ' ? 0 : length + 1;
    is_long = is_long || length > kLongestWord;
  }
  return fmt::format("<td{}>{}</td>", is_long ? " class=\"long\"" : "", escaped(text));
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
    body_ += fmt::format("<tr><th>{}</th>{}</tr>\n", escaped(what), cell(value));
  body_ += "</table>\n";
}

void HtmlReport::table(const std::vector<std::string>& columns,
                       const std::vector<std::vector<std::string>>& rows) {
  body_ += "<table>\n<tr>";
  for (const auto& column : columns) body_ += fmt::format("<th>{}</th>", escaped(column));
  body_ += "</tr>\n";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (const auto& text : row) body_ += cell(text);
    body_ += "</tr>\n";
  }
  body_ += "</table>\n";
}

void HtmlReport::plot(const LineChart& chart) {
  constexpr std::string_view kEnd = "</div><!-- plots -->\n";
  if (body_.ends_with(kEnd)) {
    body_.resize(body_.size() - kEnd.size());
  } else {
    body_ += "<div class=\"plots\">\n";
  }
  body_ += svg(chart);
  body_ += kEnd;
}

void HtmlReport::plot(const Histogram& histogram) {
  plot(line_chart(histogram));
}

void HtmlReport::plot(const VectorChart& chart) {
  plot(line_chart(chart));
}

std::string_view lamp_name(Signal signal) noexcept {
  constexpr std::array<std::string_view, 4> kNames{"red", "yellow", "green", "no verdict"};
  return kNames[static_cast<std::size_t>(signal)];
}

void HtmlReport::signal(Signal signal, std::string_view text) {
  constexpr std::array<std::string_view, 3> kLit{"#c1121f", "#e6a700", "#1a7f37"};
  std::string lamps;
  for (std::size_t i = 0; i < kLit.size(); ++i)
    lamps += fmt::format("<circle cx=\"15\" cy=\"{}\" r=\"10\" fill=\"{}\" stroke=\"#1b1f24\"/>",
                         15 + 25 * i, i == static_cast<std::size_t>(signal) ? kLit[i] : "#fff");
  body_ += fmt::format(
      "<div class=\"signal\"><svg viewBox=\"0 0 30 80\" role=\"img\"><title>{0}</title>"
      "<rect width=\"30\" height=\"80\" rx=\"6\" fill=\"#57606a\"/>{1}</svg>"
      "<span>{0}</span></div>\n",
      escaped(text), lamps);
}

void HtmlReport::list(const std::vector<std::string>& items) {
  if (items.empty()) return;
  body_ += "<ul>\n";
  for (const auto& item : items) body_ += fmt::format("<li>{}</li>\n", escaped(item));
  body_ += "</ul>\n";
}

void HtmlReport::begin_columns() {
  body_ += "<div class=\"columns\">\n";
}

void HtmlReport::end_columns() {
  body_ += "</div>\n";
}

void HtmlReport::begin_front() {
  body_ += "<div class=\"front\">\n";
}

void HtmlReport::end_front() {
  body_ += "</div>\n";
}

void HtmlReport::footer(std::string_view text) {
  footer_ = in_style_sheet(text);
}

void HtmlReport::page_break() {
  body_ += "<div class=\"page\"></div>\n";
}

void HtmlReport::maps(const ValueMaps& maps) {
  body_ += svg(maps);
}

void HtmlReport::drawing(const SpaceDrawing& drawing) {
  body_ += svg(drawing);
}

std::string HtmlReport::text() const {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta "
      "charset=\"utf-8\">\n<title>{0}</title>\n<style>{1}{2}</style>\n"
      "</head>\n<body>\n<h1>{0}</h1>\n{3}</body>\n</html>\n",
      title_, kStyle, footer_.empty() ? std::string{} : fmt::format(kFooter, footer_), body_);
}

}  // namespace abbe::daemon
