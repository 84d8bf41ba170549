#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/report/model_words.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

struct TrendPoint {
  const ReportSubject* subject = nullptr;
  CertifiedValues values;
  double days = 0.0;  ///< since the first model
};

bool is_refused(const TrendPoint& point) {
  return point.subject->entry && !point.subject->entry->accepted;
}

/// One curve over the models that the gate did not refuse.
template <class Member>
Curve trend_curve(const std::vector<TrendPoint>& points, std::string name, Member member) {
  Curve curve{.name = std::move(name), .x = {}, .y = {}};
  for (const TrendPoint& point : points) {
    if (is_refused(point)) continue;
    const calib::iso::Value value = member(point.values);
    curve.x.push_back(point.days);
    curve.y.push_back(kUmPerM * value.value);
    curve.u.push_back(kUmPerM * value.u);
  }
  return curve;
}

LineChart empty_trend(std::string title, std::string y_label) {
  return {.title = std::move(title),
          .x_label = "days since the first model",
          .y_label = std::move(y_label),
          .wide = true};
}

void add_trend_charts(HtmlReport& page, const std::vector<TrendPoint>& points) {
  LineChart positioning = empty_trend("Positioning: M of each axis", "um");
  LineChart squareness = empty_trend("Squareness", "urad");
  LineChart diagonals = empty_trend("Diagonals: M of each", "um");
  for (const calib::Axis axis : calib::kAllAxes)
    positioning.curves.push_back(trend_curve(
        points, std::string(1, letter(axis)),
        [axis](const CertifiedValues& v) { return v.standard.positioning[index(axis)].M; }));
  for (std::size_t k = 0; k < 3; ++k)
    squareness.curves.push_back(
        trend_curve(points, points.front().values.standard.squareness[k].name,
                    [k](const CertifiedValues& v) { return v.standard.squareness[k].angle; }));
  for (std::size_t k = 0; k < 4; ++k)
    diagonals.curves.push_back(
        trend_curve(points, points.front().values.standard.diagonals[k].name,
                    [k](const CertifiedValues& v) { return v.standard.diagonals[k].M; }));
  for (const LineChart* chart : {&positioning, &squareness, &diagonals}) page.plot(*chart);
}

std::string text_of_key(const CertifiedValues& values, std::string_view key) {
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (value.key == key) return with_U(value);
  return {};
}

/// To minutes: "2024-05-17T08:30", the end of the measurement; "identified 2024-05-17T08:30" if that
/// is not recorded.
std::string date_in_table(const ModelDocument& document) {
  constexpr std::size_t kMinutes = 16;
  const std::string text = to_text(time_of(document)).substr(0, kMinutes);
  return measured_of(document) ? text : "identified " + text;
}

void add_trend_table(HtmlReport& page, const std::vector<TrendPoint>& points) {
  std::vector<std::vector<std::string>> rows;
  for (const TrendPoint& point : points) {
    const VerdictInWords verdict = verdict_in_words(*point.subject);
    constexpr std::array kLamps{"red", "yellow", "green", "no verdict"};
    rows.push_back({model_id(point.subject->document), date_in_table(point.subject->document),
                    kLamps.at(static_cast<std::size_t>(verdict.signal)),
                    text_of_key(point.values, "V.max"), text_of_key(point.values, "M_d"),
                    text_of_key(point.values, "EC0Y")});
  }
  page.table(
      {"model", "measured (UTC)", "verdict", "largest |V|", "largest M of a diagonal", "EC0Y"},
      rows);
}

}  // namespace

Result<std::string> trend_report(const std::vector<ReportSubject>& models) {
  std::vector<TrendPoint> points;
  for (const ReportSubject& subject : models) {
    auto values = certified_values(subject.document);
    if (!values) return tl::make_unexpected(values.error());
    points.push_back({&subject, *std::move(values), 0.0});
  }
  if (points.empty()) return fail(ErrorCode::DataInsufficient, "trend: there are no models");
  std::ranges::stable_sort(
      points, {}, [](const TrendPoint& point) { return time_of(point.subject->document); });
  const auto first = time_of(points.front().subject->document);
  for (TrendPoint& point : points)
    point.days =
        std::chrono::duration<double, std::ratio<86400>>(time_of(point.subject->document) - first)
            .count();

  HtmlReport page(fmt::format("{}: trend", points.front().subject->document.machine));
  page.paragraph(
      fmt::format("Models: {}. Those that the gate refused are in the table, not in the charts. "
                  "Bands and \u00b1: U (k = 2). Values of models with different boxes or methods "
                  "are comparable only with care.",
                  points.size()));
  add_trend_table(page, points);
  add_trend_charts(page, points);
  return page.text();
}

}  // namespace abbe::daemon
