#include "abbe/methods/otf/report.hpp"

#include <fmt/format.h>

#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/sections.hpp"
#include "otf/residual_figures.hpp"

namespace abbe::daemon {
namespace {

constexpr int kDecimals = 3;
constexpr std::size_t kAllTables = 18;

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

}  // namespace

void add_error_tables(HtmlReport& page, const calib::VolumetricModel& model) {
  page.heading("Error motions (ISO 230-1)");
  page.paragraph(
      "Bands: expanded uncertainty U = 2 u (coverage factor k = 2, about 95 % of all cases) in the "
      "stated gauge; the legend gives the largest U of each table in the unit of the chart. A "
      "band narrower than its line is not visible.");
  if (model.tables() != nullptr && model.tables()->layout().tables().size() < kAllTables)
    page.paragraph("With one target, a missing table cannot be distinguished from the others.");
  add_table_charts(page, model);

  std::vector<std::vector<std::string>> rows;
  for (const auto& p : model.parameters()) {
    if (!p.position_m)
      rows.push_back(
          {p.name, fmt::format("{:.3f}", p.value * kUmPerM), fmt::format("{:.3f}", p.u * kUmPerM)});
  }

  page.heading("Squareness");
  page.table({"", "urad", "u, urad"}, rows);
}

namespace {

/// One curve per table over the nodes of its axis, for backlash that depends on the position.
LineChart backlash_chart(const std::vector<calib::otf::Backlash>& backlash, calib::Axis axis,
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

void add_backlash(HtmlReport& page, const std::vector<calib::otf::Backlash>& backlash) {
  if (backlash.empty()) return;
  page.heading("Backlash");
  page.paragraph(
      "The error while its axis travels forward, minus that while it travels backward. The tables "
      "above are the mean of both directions; half of each value is in the uncertainty of V. "
      "Bands: U = 2 u (k = 2). Differences that the path does not determine are left out of the "
      "charts.");
  for (const calib::Axis axis : calib::kAllAxes) {
    for (const bool angles : {false, true}) {
      const LineChart chart = backlash_chart(backlash, axis, angles);
      if (!chart.curves.empty()) page.chart(chart);
    }
  }

  std::vector<std::vector<std::string>> rows;
  for (const auto& b : backlash)
    if (!b.position_m)
      rows.push_back({calib::name(b.motion),
                      b.determined ? fmt::format("{:.3f}", b.value * kUmPerM) : "not determined",
                      b.determined ? fmt::format("{:.3f}", b.u * kUmPerM) : ""});
  if (!rows.empty()) page.table({"", "um or urad", "u, um or urad"}, rows);
}

void add_tracker_drift(HtmlReport& page, const std::optional<TrackerDriftFigures>& drift) {
  if (!drift) return;
  page.heading("Drift of the tracker");
  page.paragraph(fmt::format(
      "From {} visits of reference nests and the run itself, estimated together with the tables "
      "and removed. Largest value since the first visit, at the centre of the path; repeatability "
      "of a "
      "visit {:.1f} um.",
      drift->visits, drift->u_repeatability_m * kUmPerM));
  std::vector<std::vector<std::string>> rows;
  for (Eigen::Index k = 0; k < 3; ++k)
    rows.push_back(
        {std::string(1, "XYZ"[k]), fmt::format("{:.1f}", drift->largest_m(k) * kUmPerM)});
  page.table({"", "um"}, rows);
}

}  // namespace

std::string otf_report(const ModelDocument& document, std::span<const RunResiduals> runs,
                       const calib::Verdict& verdict) {
  const bool stands = document.mode == calib::otf::name(calib::otf::Mode::Standstill);
  HtmlReport page(
      fmt::format("{}: {} calibration", document.machine, stands ? "standstill" : "on-the-fly"));
  add_verdict(page, verdict, stands ? "positions" : "legs", kDecimals);
  add_residual_figures(page, document, runs);
  add_error_tables(page, document.model);
  add_backlash(page, document.backlash);
  add_tracker_drift(page, document.tracker_drift);
  add_volume_maps(page, document.model, left_errors(runs));
  add_origin(page, document);
  return page.text();
}

}  // namespace abbe::daemon
