#include "abbe/methods/otf/report.hpp"

#include <fmt/format.h>

#include <map>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/report/html_report.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {
namespace {

constexpr int kDecimals = 3;

std::string um(double m) {
  return um_text(m, kDecimals);
}

void add_origin(HtmlReport& page, const ModelDocument& document) {
  const auto& s = document.statistics;
  add_model_origin(
      page, document, document.inputs,
      {{"samples", fmt::format("{}, {} lost", s.samples, s.lost_samples)},
       {"observations", fmt::format("{} for {} unknowns, rank {}, condition {:.3g}", s.observations,
                                    s.unknowns, s.rank, s.condition)},
       {"sigma0", fmt::format("{:.3f} (1: residuals as large as the stated uncertainties explain)",
                              s.sigma0)},
       {"variance factor (multiplies the covariance)", fmt::format("{:.3f}", s.variance_factor)}});
}

void add_residuals(HtmlReport& page, const ModelStatistics& s,
                   const calib::otf::Residuals& residuals, std::string_view components) {
  page.heading("Residuals of the fit");
  const auto row = [](const char* what, const ResidualFigures& f) {
    return std::vector<std::string>{what, um(f.mean_abs_m), um(f.rms_m), um(f.max_abs_m)};
  };
  page.table({"", "mean", "rms", "largest"}, {row("before", s.before), row("after", s.after)});
  page.chart(Histogram{
      "before", fmt::format("error {}, um", components), {{"before", in_um(residuals.before_m)}}});
  page.chart(Histogram{
      "after", fmt::format("residual {}, um", components), {{"after", in_um(residuals.after_m)}}});
}

/// Chart of the errors of one kind (rotations if `angles`, else displacements) along one axis.
/// `axis` is the last letter of the names of these errors, for example X in EAX.
LineChart table_chart(const std::vector<calib::Parameter>& parameters, char axis, bool angles) {
  LineChart chart;
  chart.title =
      fmt::format("{} along {}", angles ? "Angular errors" : "Positioning and straightness", axis);
  chart.x_label = fmt::format("{}, mm", axis);
  chart.y_label = angles ? "urad, band: 2 u" : "um, band: 2 u";
  std::map<std::string, Curve> curves;

  for (const auto& p : parameters) {
    if (!p.position_m || p.name.back() != axis || p.is_angle() != angles) continue;
    Curve& curve = curves[p.name];
    curve.name = p.name;
    curve.x.push_back(*p.position_m * kMmPerM);
    curve.y.push_back(p.value * kUmPerM);
    curve.u.push_back(p.u * kUmPerM);
  }

  for (auto& [name, curve] : curves) chart.curves.push_back(std::move(curve));
  return chart;
}

}  // namespace

void add_error_tables(HtmlReport& page, const calib::VolumetricModel& model) {
  page.heading("Error motions (ISO 230-1)");
  page.paragraph(
      "Each with twice its standard uncertainty in the stated gauge. With one target, a missing "
      "table cannot be distinguished from the others.");
  const auto parameters = model.parameters();

  for (const char axis : {'X', 'Y', 'Z'}) {
    for (const bool angles : {false, true}) {
      const LineChart chart = table_chart(parameters, axis, angles);
      if (!chart.curves.empty()) page.chart(chart);
    }
  }

  std::vector<std::vector<std::string>> rows;
  for (const auto& p : parameters) {
    if (!p.position_m)
      rows.push_back(
          {p.name, fmt::format("{:.3f}", p.value * kUmPerM), fmt::format("{:.3f}", p.u * kUmPerM)});
  }

  page.heading("Squareness");
  page.table({"", "urad", "u, urad"}, rows);
}

namespace {

void add_backlash(HtmlReport& page, const std::vector<calib::otf::Backlash>& backlash) {
  if (backlash.empty()) return;
  page.heading("Backlash");
  page.paragraph(
      "The error while its axis travels forward, minus that while it travels backward. The tables "
      "above are the mean of both directions; half of each value is in the uncertainty of V.");
  std::vector<std::vector<std::string>> rows;
  for (const auto& b : backlash)
    rows.push_back(
        {calib::name(b.motion), b.position_m ? fmt::format("{:.1f}", *b.position_m * kMmPerM) : "",
         fmt::format("{:.3f}", b.value * kUmPerM), fmt::format("{:.3f}", b.u * kUmPerM)});
  page.table({"", "at, mm", "um or urad", "u, um or urad"}, rows);
}

}  // namespace

std::string otf_report(const ModelDocument& document, const calib::otf::Residuals& residuals,
                       const calib::Verdict& verdict) {
  const bool stands = document.mode == calib::otf::name(calib::otf::Mode::Standstill);
  HtmlReport page(
      fmt::format("{}: {} calibration", document.machine, stands ? "standstill" : "on-the-fly"));
  add_verdict(page, verdict, stands ? "positions" : "legs", kDecimals);
  add_residuals(page, document.statistics, residuals,
                stands ? "along and across the beam" : "across the path");
  add_error_tables(page, document.model);
  add_backlash(page, document.backlash);
  add_origin(page, document);
  return page.text();
}

}  // namespace abbe::daemon
