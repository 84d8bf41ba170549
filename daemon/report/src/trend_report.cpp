#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/result/try.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

struct TrendPoint {
  const ReportSubject* subject = nullptr;
  CertifiedValues values;
  double days = 0.0;  ///< days since the first model
};

bool is_refused(const TrendPoint& point) {
  return point.subject->entry && !point.subject->entry->accepted;
}

const CertifiedValue* value_of_key(const CertifiedValues& values, std::string_view key) {
  for (const ValueGroup& group : values.groups)
    for (const CertifiedValue& value : group.values)
      if (value.key == key) return &value;
  return nullptr;
}

/// One curve over the models that have the value and that the gate did not refuse.
Curve trend_curve(const std::vector<TrendPoint>& points, const std::string& key) {
  Curve curve{.name = key, .x = {}, .y = {}};
  for (const TrendPoint& point : points) {
    const CertifiedValue* const found = value_of_key(point.values, key);
    if (is_refused(point) || found == nullptr || found->value.empty()) continue;
    curve.x.push_back(point.days);
    curve.y.push_back(kUmPerM * found->value_si);
    curve.u.push_back(kUmPerM * found->u_si);
  }
  return curve;
}

/// A chart with one curve for each of `keys` that at least one model has; none without such a key.
void add_trend_chart(HtmlReport& page, const std::vector<TrendPoint>& points, std::string title,
                     std::string y_label, const std::vector<std::string>& keys) {
  LineChart chart{.title = std::move(title),
                  .x_label = "days since the first model",
                  .y_label = std::move(y_label),
                  .wide = true};
  for (const std::string& key : keys)
    if (Curve curve = trend_curve(points, key); !curve.x.empty())
      chart.curves.push_back(std::move(curve));
  if (!chart.curves.empty()) page.plot(chart);
}

void add_trend_charts(HtmlReport& page, const std::vector<TrendPoint>& points) {
  const auto add = [&](std::string title, std::string unit, const std::vector<std::string>& keys) {
    add_trend_chart(page, points, std::move(title), std::move(unit), keys);
  };
  add("Positioning: M of each axis", "um", {"X.M", "Y.M", "Z.M"});
  add("Reversal error B of each axis", "um", {"X.B", "Y.B", "Z.B"});
  for (const calib::Axis axis : calib::kAllAxes) {
    const char a = letter(axis);
    std::vector<std::string> straight;
    for (const char in : {'X', 'Y', 'Z'})
      if (in != a) straight.push_back(fmt::format("E{}{}", in, a));
    add(fmt::format("Straightness of {}", a), "um", straight);
  }
  add("Squareness", "urad", {"EC0Y", "EB0Z", "EA0Z"});
  for (const calib::Axis axis : calib::kAllAxes) {
    const char a = letter(axis);
    add(fmt::format("Angular errors of {}: range", a), "urad",
        {fmt::format("EA{}", a), fmt::format("EB{}", a), fmt::format("EC{}", a)});
  }
  add("Diagonals: M of each", "um", {"PPP.M", "NPP.M", "PNP.M", "NNP.M"});
}

std::string text_of_key(const CertifiedValues& values, std::string_view key) {
  const CertifiedValue* const value = value_of_key(values, key);
  return value != nullptr ? with_U(*value) : std::string();
}

/// The date to whole minutes: "2024-05-17T08:30", the end of the measurement, or "identified
/// 2024-05-17T08:30" if this is not recorded.
std::string date_in_table(const ModelDocument& document) {
  constexpr std::size_t kMinutes = 16;
  const std::string text = to_text(time_of(document)).substr(0, kMinutes);
  return measured_of(document) ? text : "identified " + text;
}

void add_trend_table(HtmlReport& page, const std::vector<TrendPoint>& points) {
  std::vector<std::vector<std::string>> rows;
  for (const TrendPoint& point : points) {
    const VerdictInWords verdict = verdict_in_words(*point.subject);
    rows.push_back({model_id(point.subject->document), date_in_table(point.subject->document),
                    std::string{lamp_name(verdict.signal)}, text_of_key(point.values, "V.max"),
                    text_of_key(point.values, "M_d"), text_of_key(point.values, "EC0Y")});
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
    ABBE_TRY(values);
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
