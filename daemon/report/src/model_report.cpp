#include "abbe/report/model_report.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/report/sections.hpp"
#include "abbe/report/space_drawing.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

void add_fit(HtmlReport& page, const ModelStatistics& s) {
  page.heading("Residuals of the fit");
  const auto row = [](const char* what, const ResidualFigures& f) {
    return std::vector<std::string>{what, um_text(f.mean_abs_m, 3), um_text(f.rms_m, 3),
                                    um_text(f.max_abs_m, 3)};
  };
  page.table({"", "mean", "rms", "largest"},
             {row("before the fit", s.before), row("after", s.after)});
}

/// What was not used in the fit, before and after.
void add_held_out(HtmlReport& page, const RunFigures& run) {
  if (run.held_out_before_m > 0.0)
    page.facts(
        {{fmt::format("error at {} excluded from the fit, without compensation", run.held_out),
          um_text(run.held_out_before_m, 3) + " rms"},
         {"with the model", um_text(run.held_out_after_m, 3) + " rms"}});
}

/// The residuals in the order of the run.
void add_run_residuals(HtmlReport& page, const RunFigures& run) {
  if (run.residuals.empty()) return;
  page.heading("Residuals along the path");
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

/// The path or the places of the artefact, in the box of the model and around it.
void add_places(HtmlReport& page, const ModelDocument& document, const calib::iso::LineBox& box) {
  if (!document.run || document.run->places_m.empty()) return;
  calib::Vector3 low_m = box.low_m, high_m = box.high_m;
  SpaceDrawing drawing{.title = "Where was measured", .box_mm = {}, .lines = {}};
  for (const auto& line : document.run->places_m) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      low_m = low_m.cwiseMin(line[i]);
      high_m = high_m.cwiseMax(line[i]);
      if (i > 0) drawing.lines.push_back({"", kMmPerM * line[i - 1], kMmPerM * line[i]});
    }
  }
  drawing.box_mm = {kMmPerM * low_m, kMmPerM * high_m};
  drawing.one_colour = true;
  const auto what = document.method == "otf"     ? "the driven path"
                    : document.method == "evemu" ? "the balls in each position of the array"
                                                 : "the bar in each of its positions";
  page.heading("Where was measured");
  page.paragraph(fmt::format("Scale readings: {}.", what));
  page.drawing(drawing);
}

void add_passes(HtmlReport& page, const BarFigures& bar) {
  page.heading("Residuals of the measurements with the bar");
  std::vector<std::vector<std::string>> rows;
  for (const BarFigures::Pass& pass : bar.passes)
    rows.push_back({pass.measurement, fmt::format("{:.3f}", pass.chi2_per_dof)});
  page.table({"measurement", "chi-square per degree of freedom"}, rows);
  if (bar.set_aside.empty()) return;
  rows.clear();
  for (const BarFigures::SetAside& t : bar.set_aside)
    rows.push_back(
        {fmt::format("{}, {} {} {} k {}", t.measurement, t.feature, t.index, t.side, t.k),
         um_text(t.residual_m)});
  page.table({"excluded touch", "residual"}, rows);
}

void add_words(HtmlReport& page, const ModelDocument& document) {
  page.heading("What the uncertainty does not contain");
  page.list(not_in_the_uncertainty(document));
  page.heading("What cannot be estimated, and why");
  page.list(not_estimable(document));
  page.heading("Gauge and signs");
  page.paragraph(gauge_in_words(document.model));
  page.list(signs_in_words());
}

}  // namespace

Result<std::string> model_report(const ReportSubject& subject) {
  const ModelDocument& document = subject.document;
  const auto values = certified_values(document);
  if (!values) return tl::make_unexpected(values.error());

  HtmlReport page(fmt::format("{}: geometric calibration", document.machine));
  page.paragraph(fmt::format("Model {}, {}.", model_id(document), method_in_words(document)));
  add_verdict_of(page, subject);
  add_values(page, *values, 0, 1);
  page.paragraph(box_in_words(values->standard));
  add_fit(page, document.statistics);
  if (document.run) add_held_out(page, *document.run);
  if (document.bar) add_passes(page, *document.bar);

  page.page_break();
  page.begin_columns();
  add_values(page, *values, 1, values->groups.size());
  page.end_columns();
  page.page_break();
  add_value_curves(page, *values);
  if (document.run) add_run_residuals(page, *document.run);
  add_places(page, document, values->standard.box);
  add_field(page, document.model, values->standard.box);
  if (document.model.tables() != nullptr) {
    page.heading("Tables of the model");
    for (const LineChart& chart : table_line_charts(document.model)) page.plot(chart);
  }
  add_volume_maps(page, document.model);
  add_words(page, document);
  add_origin_of(page, subject);
  return page.text();
}

}  // namespace abbe::daemon
