#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/base/units.hpp"
#include "abbe/report/sections.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

constexpr int kDecimals = 3;

/// Adds the rms in intervals of the path, before and after compensation.
void add_along_path(HtmlReport& page, const RunFigures& run) {
  if (run.residuals.empty()) return;
  Curve before{.name = "before", .x = {}, .y = {}, .dot_every = 0};
  Curve after{.name = "after", .x = {}, .y = {}, .dot_every = 0};
  for (const RunFigures::Interval& i : run.residuals) {
    before.x.push_back(i.at_m);
    after.x.push_back(i.at_m);
    before.y.push_back(kUmPerM * i.before_m);
    after.y.push_back(kUmPerM * i.after_m);
  }
  for (const Curve& curve : {before, after})
    page.plot({.title = fmt::format("Residuals of the fit along the path, rms, {}", curve.name),
               .x_label = "length of the path, m",
               .y_label = "um",
               .curves = {curve}});
}

void add_series(HtmlReport& page, const RunFigures::Series& series) {
  Curve curve{.name = "residual", .x = {}, .y = {}, .dot_every = 0};
  for (const RunFigures::Series::Point& p : series.points) {
    curve.x.push_back(p.at);
    curve.y.push_back(kUmPerM * p.after_m);
  }
  page.plot({.title = series.over_time ? "Residuals of the fit over time"
                                       : "Residuals of the fit in the order of the run",
             .x_label = series.over_time ? "time from the beginning of the run, s"
                                         : "number of the residual",
             .y_label = "um",
             .curves = {curve},
             .wide = true});
  std::string text = fmt::format("{} residuals", series.count);
  if (series.points.size() < series.count)
    text += fmt::format(
        "; of each of {} equal intervals the smallest and the largest are drawn, {} in all",
        RunFigures::Series::kMostPoints / 2, series.points.size());
  if (!series.over_time) text += "; their times are not recorded";
  page.paragraph(text + ".");
}

/// Standard deviation of (residual / its stated uncertainty) that the fit predicts: with n
/// observations and f degrees of freedom it is sqrt(f / n). 0: no prediction.
double predicted_sd(const ModelDocument& document) {
  const ModelStatistics& s = document.statistics;
  if (document.method == "evemu" || s.observations == 0) return 0.0;
  double freedom = s.degrees_of_freedom.value_or(0.0);
  // In models of earlier versions, the rank of a model from a bar counts all unknowns that have a
  // prior.
  if (!s.degrees_of_freedom && document.method == "otf" && s.observations > s.rank)
    freedom = static_cast<double>(s.observations - s.rank);
  return freedom > 0.0 ? std::sqrt(freedom / static_cast<double>(s.observations)) : 0.0;
}

/// Adds a histogram of the residuals, and the counts that the stated uncertainties predict.
void add_sigma_counts(HtmlReport& page, const RunFigures& run, const ModelDocument& document) {
  if (run.sigma_counts.empty()) return;
  constexpr double kMost = RunFigures::kMostSigmas;
  const double width = 2.0 * kMost / static_cast<double>(run.sigma_counts.size());
  double all = 0.0;
  for (const std::size_t count : run.sigma_counts) all += static_cast<double>(count);
  const double sd = predicted_sd(document);
  const auto below = [sd](double x) { return 0.5 * std::erfc(-x / (sd * std::numbers::sqrt2)); };

  Curve bars{.name = "residuals", .x = {}, .y = {}, .dot_every = 0};
  Curve normal{.name = "as predicted", .x = {}, .y = {}, .dot_every = 0};
  for (std::size_t i = 0; i < run.sigma_counts.size(); ++i) {
    const double from = -kMost + width * static_cast<double>(i), to = from + width;
    const auto count = static_cast<double>(run.sigma_counts[i]);
    bars.x.insert(bars.x.end(), {from, to});
    bars.y.insert(bars.y.end(), {count, count});
    normal.x.push_back(0.5 * (from + to));
    if (sd > 0.0) normal.y.push_back(all * (below(to) - below(from)));
  }
  bars.low.assign(bars.y.size(), 0.0);
  bars.high = bars.y;
  LineChart chart{.title = "Residuals in standard uncertainties",
                  .x_label = "residual / its standard uncertainty",
                  .y_label = "count",
                  .curves = {bars}};
  if (sd > 0.0) chart.curves.push_back(normal);
  page.plot(chart);
  if (document.method == "evemu")
    page.paragraph(
        "Residuals in standard uncertainties have no predicted distribution here: the noise of a "
        "ball centre is estimated from these residuals, and the noise of ball 1 is common to all "
        "balls of a position.");
}

void add_rms_of_parts(HtmlReport& page, const RunFigures& run) {
  Curve rms{.name = "rms", .x = {}, .y = {}}, largest{.name = "largest", .x = {}, .y = {}};
  double number = 0.0;
  for (const RunFigures::Part& part : run.parts) {
    number += 1.0;
    rms.x.push_back(number);
    largest.x.push_back(number);
    rms.y.push_back(kUmPerM * part.after_rms_m);
    largest.y.push_back(kUmPerM * part.after_max_m);
  }
  page.plot({.title = fmt::format("Residuals by {}", run.part_kind),
             .x_label = fmt::format("{}, in the order of the table", run.part_kind),
             .y_label = "um",
             .curves = {rms, largest}});
}

std::vector<std::string> row_of(const RunFigures::Part& part) {
  return {part.name,
          fmt::to_string(part.count),
          fmt::format("{:.3f}", kUmPerM * part.before_rms_m),
          fmt::format("{:.3f}", kUmPerM * part.after_rms_m),
          fmt::format("{:.3f}", kUmPerM * part.after_max_m),
          part.time_s ? fmt::format("{:.1f} to {:.1f}", (*part.time_s)[0], (*part.time_s)[1])
                      : "not recorded"};
}

/// Adds a table of the parts of the run; of many parts, those with the largest residuals.
void add_table_of_parts(HtmlReport& page, const RunFigures& run) {
  constexpr std::size_t kShown = 24;
  std::vector<const RunFigures::Part*> parts;
  for (const RunFigures::Part& part : run.parts) parts.push_back(&part);
  if (parts.size() > kShown) {
    std::ranges::stable_sort(
        parts, [](const auto* a, const auto* b) { return a->after_rms_m > b->after_rms_m; });
    parts.resize(kShown);
    page.paragraph(
        fmt::format("The {} of {} parts of the run with the largest rms; model.json has "
                    "all of them.",
                    kShown, run.parts.size()));
  }
  std::vector<std::vector<std::string>> rows;
  for (const RunFigures::Part* part : parts) rows.push_back(row_of(*part));
  const std::vector<std::string> columns{run.part_kind,   "count",       "before, rms um",
                                         "after, rms um", "largest, um", "time, s"};
  const auto half = rows.begin() + static_cast<std::ptrdiff_t>((rows.size() + 1) / 2);
  page.begin_columns();
  page.table(columns, {rows.begin(), half});
  if (half != rows.end()) page.table(columns, {half, rows.end()});
  page.end_columns();
}

void add_bar(HtmlReport& page, const BarFigures& bar) {
  page.heading("Measurements with the bar");
  std::vector<std::vector<std::string>> rows;
  for (const BarFigures::Pass& pass : bar.passes)
    rows.push_back({pass.measurement, fmt::format("{:.3f}", pass.chi2_per_dof)});
  page.table({"measurement", "chi-square per degree of freedom"}, rows);

  page.heading("Excluded touches");
  rows.clear();
  for (const BarFigures::SetAside& t : bar.set_aside)
    rows.push_back({t.measurement, fmt::format("{} {} {}", t.feature, t.index, t.side),
                    fmt::to_string(t.k), um_text(t.residual_m, kDecimals)});
  if (rows.empty())
    page.paragraph("None.");
  else
    page.table({"measurement", "feature", "k", "from the other touches of the feature"}, rows);

  if (bar.drift.empty()) return;
  page.heading("Drift of the machine");
  page.paragraph(
      "Displacement of the readings during one pass along the bar, from a forward and a backward "
      "pass, with its standard uncertainty. It is taken out of the measurements.");
  rows.clear();
  for (const BarFigures::Drift& d : bar.drift) {
    std::vector<std::string> row{fmt::format("{}, {}", d.forward, d.backward)};
    for (Eigen::Index c = 0; c < 3; ++c)
      row.push_back(fmt::format("{:.3f} ({:.3f})", kUmPerM * d.rate_m(c), kUmPerM * d.u_rate_m(c)));
    rows.push_back(std::move(row));
  }
  page.table({"passes", "X, um per pass (u)", "Y", "Z"}, rows);
}

void add_tracker_drift(HtmlReport& page, const TrackerDriftFigures& drift) {
  page.heading("Drift of the tracker");
  page.paragraph(fmt::format(
      "From {} visits of reference nests and the run itself, estimated together with the tables "
      "and removed. Largest value since the first visit, at the centre of the path; repeatability "
      "of a visit {:.1f} um.",
      drift.visits, kUmPerM * drift.u_repeatability_m));
  std::vector<std::vector<std::string>> rows;
  for (Eigen::Index k = 0; k < 3; ++k)
    rows.push_back({std::string(1, "XYZ"[k]), fmt::format("{:.1f}", kUmPerM * drift.largest_m(k))});
  page.table({"", "um"}, rows);
}

/// One curve per table over the nodes of its axis, for backlash that depends on the position.
LineChart backlash_chart(const std::vector<calib::Backlash>& backlash, calib::Axis axis,
                         bool angles) {
  LineChart chart{.title = fmt::format("Backlash of {}, {}", letter(axis),
                                       angles ? "rotations" : "translations"),
                  .x_label = fmt::format("{}, mm", letter(axis)),
                  .y_label = angles ? "urad" : "um"};
  for (const auto& b : backlash) {
    if (b.motion.axis != axis || is_rotation(b.motion.motion) != angles) continue;
    if (!b.position_m || !b.determined) continue;
    const std::string name = calib::name(b.motion);
    if (chart.curves.empty() || chart.curves.back().name != name)
      chart.curves.push_back({.name = name, .x = {}, .y = {}});
    Curve& curve = chart.curves.back();
    curve.x.push_back(*b.position_m * kMmPerM);
    curve.y.push_back(b.value * kUmPerM);
    curve.u.push_back(b.u * kUmPerM);
  }
  return chart;
}

}  // namespace

std::string whose_residuals(const ModelDocument& document) {
  if (!document.run || document.run->of_model.empty()) return {};
  return fmt::format(
      "This model is an update of the model before it with a run. Residuals, statistics and the "
      "test with what was excluded from the fit are those of the model of the run alone, {}.",
      document.run->of_model);
}

void add_residuals_of(HtmlReport& page, const ModelDocument& document) {
  page.heading("Residuals over time and by part of the run");
  if (is_joint(document)) {
    page.paragraph(kResidualsOfParts);
    return;
  }
  const bool has_parts = document.run && document.run->series && !document.run->parts.empty();
  if (!document.run || (!has_parts && document.run->residuals.empty())) {
    page.paragraph(kNotRecorded);
    return;
  }
  const RunFigures& run = *document.run;
  if (const std::string whose = whose_residuals(document); !whose.empty()) page.paragraph(whose);
  page.paragraph("What the model does not explain of the observations to which it was fitted.");
  if (has_parts) add_series(page, *run.series);
  add_along_path(page, run);
  if (!has_parts) return;
  add_sigma_counts(page, run, document);
  add_rms_of_parts(page, run);
  add_table_of_parts(page, run);
}

void add_backlash_of(HtmlReport& page, const ModelDocument& document) {
  std::vector<LineChart> charts;
  for (const calib::Axis axis : calib::kAllAxes)
    for (const bool angles : {false, true})
      if (LineChart chart = backlash_chart(document.backlash, axis, angles); !chart.curves.empty())
        charts.push_back(std::move(chart));

  std::vector<std::vector<std::string>> rows;
  for (const auto& b : document.backlash)
    if (!b.position_m)
      rows.push_back({calib::name(b.motion), fmt::format("{:.3f}", b.value * kUmPerM),
                      fmt::format("{:.3f}", b.u * kUmPerM)});
  if (charts.empty() && rows.empty()) return;
  page.heading("Backlash of the tables");
  page.paragraph(
      "The error while its axis travels forward, minus that while it travels backward. The tables "
      "are the mean of both directions; half of each value is in the uncertainty of V.");
  for (const LineChart& chart : charts) page.plot(chart);
  if (!rows.empty()) page.table({"", "um or urad", "u, um or urad"}, rows);
}

void add_tables_of_method(HtmlReport& page, const ModelDocument& document) {
  if (document.tracker_drift) add_tracker_drift(page, *document.tracker_drift);
  if (document.bar) add_bar(page, *document.bar);
  if (!document.run) return;
  for (const RunFigures::Table& table : document.run->tables) {
    page.heading(table.title);
    if (!table.explanation.empty()) page.paragraph(table.explanation);
    if (!table.columns.empty()) {
      page.table(table.columns, table.rows);
      continue;
    }
    std::vector<std::pair<std::string, std::string>> facts;
    for (const auto& row : table.rows)
      if (row.size() == 2) facts.emplace_back(row[0], row[1]);
    page.facts(facts);
  }
}

}  // namespace abbe::daemon
