#include "mfb/pass_figures.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

constexpr int kUmDecimals = 3;
constexpr std::array<const char*, 3> kBarAxes{"x, along the bar", "y", "z, along the holes"};

double rms_m_of(std::span<const calib::Vector3> vectors_m) {
  double squares = 0.0;
  for (const calib::Vector3& v : vectors_m) squares += v.squaredNorm();
  return std::sqrt(squares / (3.0 * static_cast<double>(vectors_m.size())));
}

/// One curve per component of vectors at the holes of a bar.
LineChart chart_along_bar(std::string title, std::string y_label, const mfb::Bar& bar,
                          std::span<const calib::Vector3> vectors_m) {
  LineChart chart{.title = std::move(title),
                  .x_label = "position along the bar, mm",
                  .y_label = std::move(y_label)};
  for (std::size_t c = 0; c < kBarAxes.size(); ++c) {
    Curve curve{.name = kBarAxes.at(c), .x = {}, .y = {}};
    for (std::size_t i = 0; i < vectors_m.size(); ++i) {
      curve.x.push_back(bar.pattern.hole_x_m[i] * kMmPerM);
      curve.y.push_back(vectors_m[i](static_cast<Eigen::Index>(c)) * kUmPerM);
    }
    chart.curves.push_back(std::move(curve));
  }
  return chart;
}

void add_table_of_measurements(HtmlReport& page, const MfbCandidate& candidate) {
  std::vector<std::vector<std::string>> rows;
  for (const mfb::PassResiduals& pass : candidate.found.solution.residuals)
    rows.push_back({pass.measurement, fmt::format("{:.2f}", pass.chi2 / pass.degrees_of_freedom),
                    um_text(rms_m_of(pass.before_m), kUmDecimals),
                    um_text(rms_m_of(pass.O_m), kUmDecimals),
                    um_text(rms_m_of(pass.u_O_m), kUmDecimals)});
  page.table({"measurement", "chi-square per degree of freedom", "errors, rms", "residuals, rms",
              "standard uncertainty of a point"},
             rows);
}

/// Corrections of the calibrated points that the adjustment found, within their uncertainty.
void add_corrections_of_bar(HtmlReport& page, const MfbCandidate& candidate) {
  const mfb::Bar& bar = candidate.found.observations.bar;
  const Eigen::VectorXd& all = candidate.found.solution.bar_correction_m;
  if (all.size() != 3 * std::ssize(bar.O_m)) return;
  std::vector<calib::Vector3> corrections_m;
  for (Eigen::Index i = 0; i < std::ssize(bar.O_m); ++i)
    corrections_m.emplace_back(all.segment<3>(3 * i));
  page.chart(chart_along_bar(fmt::format("Corrections of bar \"{}\"", bar.name),
                             "correction of the calibrated point, um", bar, corrections_m));
}

/// Names of the measurements in each position.
std::vector<std::string> measurements_of_positions(const mfb::Observations& o) {
  std::vector<std::string> names(o.positions.size());
  for (const mfb::PassObservation& pass : o.passes) {
    std::string& all = names[pass.position];
    all += (all.empty() ? "" : ", ") + o.plan.measurements[pass.measurement].name;
  }
  return names;
}

/// The range of the nodes, shifted from scale readings to the tip of the first measurement.
std::array<calib::Vector3, 2> range_of_tip_mm(const mfb::Observations& o) {
  std::array<calib::Vector3, 2> range_mm;
  const calib::Vector3& t = o.plan.measurements.front().tool_offset_m;
  for (const calib::Axis axis : calib::kAllAxes) {
    const auto& nodes_m = o.basis.layout().nodes()[index(axis)].nodes_m;
    const auto k = static_cast<Eigen::Index>(index(axis));
    range_mm[0](k) = kMmPerM * (nodes_m.front() + t(k));
    range_mm[1](k) = kMmPerM * (nodes_m.back() + t(k));
  }
  return range_mm;
}

SpaceDrawing drawing_of_positions(const MfbCandidate& candidate) {
  const mfb::Observations& o = candidate.found.observations;
  const auto& poses = candidate.found.solution.poses;
  SpaceDrawing drawing{
      .title = "The bar in its positions", .box_mm = range_of_tip_mm(o), .lines = {}};
  for (std::size_t p = 0; p < o.positions.size() && p < poses.size(); ++p) {
    const calib::Vector3 first_m = poses[p].origin_m;
    const calib::Vector3 last_m = first_m + poses[p].axes * o.bar.O_m.back();
    drawing.lines.push_back({o.positions[p].name, kMmPerM * first_m, kMmPerM * last_m});
  }
  return drawing;
}

}  // namespace

void add_residuals_along_bar(HtmlReport& page, const MfbCandidate& candidate) {
  const mfb::Bar& bar = candidate.found.observations.bar;
  page.heading("Residuals along the bar");
  page.paragraph(
      "Errors: what the machine shows of the bar without correction, after the best fit of the "
      "pose of the bar and the drift. Residuals: what the identified errors do not explain. Both "
      "at the calibrated points, in bar axes.");
  add_table_of_measurements(page, candidate);
  for (const mfb::PassResiduals& pass : candidate.found.solution.residuals)
    page.chart(chart_along_bar(pass.measurement, "residual, um", bar, pass.O_m));
  add_corrections_of_bar(page, candidate);
}

void add_positions_of_bar(HtmlReport& page, const MfbCandidate& candidate) {
  const mfb::Observations& o = candidate.found.observations;
  page.heading("The bar in the machine");
  page.paragraph(
      "Each line is the bar in one position, as it was found, where the tip touches it; the dot is "
      "hole 1, the label stands at the last hole. Frame: the range of the nodes for the tool of "
      "the "
      "first measurement.");
  page.drawing(drawing_of_positions(candidate));

  const auto measurements = measurements_of_positions(o);
  std::vector<std::vector<std::string>> rows;
  for (std::size_t p = 0; p < o.positions.size(); ++p) {
    const mfb::PositionOfBar& position = o.positions[p];
    const calib::Vector3 beside = (position.pose.origin_m - position.planned.origin_m) * kMmPerM;
    rows.push_back({position.name, measurements[p],
                    fmt::format("{:.2f}, {:.2f}, {:.2f}", beside.x(), beside.y(), beside.z())});
  }
  page.table({"position", "measurements", "hole 1 beside the plan in X, Y, Z, mm"}, rows);
}

void add_drift_of_passes(HtmlReport& page, const MfbCandidate& candidate) {
  const auto& drift = candidate.found.solution.drift;
  if (drift.empty()) return;
  page.heading("Drift of the machine");
  page.paragraph(
      "Displacement of the readings during one pass along the bar, from a forward and a backward "
      "pass, with its standard uncertainty. It is taken out of the measurements.");
  std::vector<std::vector<std::string>> rows;
  for (const mfb::PairDrift& pair : drift) {
    std::vector<std::string> row{fmt::format("{}, {}", pair.forward, pair.backward)};
    for (Eigen::Index c = 0; c < 3; ++c)
      row.push_back(
          fmt::format("{:.3f} ({:.3f})", pair.rate_m(c) * kUmPerM, pair.u_rate_m(c) * kUmPerM));
    rows.push_back(std::move(row));
  }
  page.table({"passes", "X, um per pass (u)", "Y", "Z"}, rows);
}

void add_touches_set_aside(HtmlReport& page, const MfbCandidate& candidate) {
  page.heading("Excluded touches");
  if (candidate.found.set_aside.empty()) {
    page.paragraph("None.");
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const mfb::SetAsideTouch& touch : candidate.found.set_aside)
    rows.push_back({touch.measurement_name, mfb::feature_name(touch.target),
                    fmt::to_string(touch.target.k), um_text(touch.residual_m, kUmDecimals)});
  page.table({"measurement", "feature", "k", "from the other touches of the feature"}, rows);
}

}  // namespace abbe::daemon
