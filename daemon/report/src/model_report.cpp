#include "abbe/report/model_report.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/report/sections.hpp"
#include "abbe/report/space_drawing.hpp"
#include "abbe/result/try.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

void add_fit(HtmlReport& page, const ModelDocument& document) {
  page.heading("Residuals of the fit");
  if (is_joint(document)) {
    page.paragraph(kResidualsOfParts);
    return;
  }
  if (const std::string whose = whose_residuals(document); !whose.empty()) page.paragraph(whose);
  const ModelStatistics& s = document.statistics;
  const auto row = [](const char* what, const ResidualFigures& f) {
    return std::vector<std::string>{what, um_text(f.mean_abs_m, 3), um_text(f.rms_m, 3),
                                    um_text(f.max_abs_m, 3)};
  };
  page.table({"", "mean", "rms", "largest"},
             {row("before the fit", s.before), row("after", s.after)});
}

/// Adds the rms of the held-out observations before and after compensation.
void add_held_out(HtmlReport& page, const RunFigures& run) {
  if (run.held_out_before_m > 0.0)
    page.facts(
        {{fmt::format("error at {} excluded from the fit, without compensation", run.held_out),
          um_text(run.held_out_before_m, 3) + " rms"},
         {"with the model", um_text(run.held_out_after_m, 3) + " rms"}});
}

/// Adds a drawing of the path or of the places of the artefact, with the box of the model.
void add_places(HtmlReport& page, const ModelDocument& document, const calib::iso::LineBox& box) {
  page.heading("Where was measured");
  if (!document.run || document.run->places_m.empty()) {
    page.paragraph(kNotRecorded);
    return;
  }
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
                    : document.method == "joint" ? "the driven paths of its runs"
                                                 : "the bar in each of its positions";
  page.paragraph(fmt::format("Scale readings: {}.", what));
  page.drawing(drawing);
}

/// Adds the tables as curves, or the coefficients of a polynomial model.
void add_parameters(HtmlReport& page, const calib::VolumetricModel& model) {
  if (model.tables() != nullptr) {
    page.heading("Error motions: tables of the model");
    page.paragraph(
        "Bands: U = 2 u (k = 2) in the datum of the model; the legend gives the largest U of each "
        "table.");
    for (const LineChart& chart : table_line_charts(model)) page.plot(chart);
    return;
  }
  page.heading("Coefficients of the equivalent model");
  page.paragraph("Names of Li et al., Table 3.");
  std::vector<std::vector<std::string>> rows;
  for (const auto& c : model.polynomials()->named_coefficients())
    rows.push_back({c.name, fmt::format("{:.6g}", c.value), fmt::format("{:.2g}", c.u), c.unit});
  const auto half = rows.begin() + static_cast<std::ptrdiff_t>((rows.size() + 1) / 2);
  page.begin_columns();
  page.table({"", "value", "u", "unit"}, {rows.begin(), half});
  if (half != rows.end()) page.table({"", "value", "u", "unit"}, {half, rows.end()});
  page.end_columns();
}

void add_words(HtmlReport& page, const ModelDocument& document) {
  page.heading("What the uncertainty does not contain");
  page.list(not_in_the_uncertainty(document));
  page.heading("What cannot be estimated, and why");
  page.list(not_estimable(document));
  page.heading("Datum and signs");
  page.paragraph(datum_in_words(document.model));
  page.list(signs_in_words());
}

}  // namespace

Result<std::string> model_report(const ReportSubject& subject) {
  const ModelDocument& document = subject.document;
  const auto values = certified_values(document);
  ABBE_TRY(values);

  HtmlReport page(fmt::format("{}: geometric calibration", document.machine));
  add_footer(page, document);
  page.paragraph(fmt::format("Model {}, {}.", model_id(document), method_in_words(document)));
  ABBE_TRY(add_front(page, subject, *values));

  page.begin_columns();
  add_values(page, *values, 0, values->groups.size());
  page.end_columns();
  page.paragraph(box_in_words(values->standard));
  add_not_estimable(page, *values);
  add_fit(page, document);
  if (document.run) add_held_out(page, *document.run);
  add_value_curves(page, *values);
  add_field(page, document.model, values->standard.box);
  add_parameters(page, document.model);
  add_backlash_of(page, document);
  add_volume_maps(
      page, document.model,
      document.run ? document.run->held_out_cells : std::vector<RunFigures::HeldOutCell>{});
  add_places(page, document, values->standard.box);
  add_residuals_of(page, document);
  add_tables_of_method(page, document);
  add_words(page, document);
  add_origin_of(page, subject);
  return page.text();
}

}  // namespace abbe::daemon
