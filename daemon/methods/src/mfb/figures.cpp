#include "mfb/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/methods/run_figures.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

using Table = RunFigures::Table;

Table chi_square_table(const mfb::Identification& found) {
  const mfb::Statistics& s = found.solution.statistics;
  Table table{
      .title = "Chi-square",
      .explanation = "1: residuals as large as the stated noise.",
      .columns = {},
      .rows = {
          {"per degree of freedom",
           fmt::format("{:.3f}, at most {:.3f}", s.chi2_per_dof, s.chi2_per_dof_limit)},
          {"chi-square, degrees of freedom",
           fmt::format("{:.1f}, {:.1f}", s.chi2, s.degrees_of_freedom)},
          {"with the corrections of the bar and of other values that have a stated "
           "uncertainty, per degree of freedom",
           fmt::format("{:.3f}, at most {:.3f}", s.all_chi2_per_dof, s.all_chi2_per_dof_limit)}}};
  if (found.cause.cause != mfb::Cause::None) {
    table.rows.push_back({"likely cause", found.cause.text});
    table.rows.push_back({"per degree of freedom with this cause taken into account",
                          fmt::format("{:.3f}", found.cause.chi2_per_dof_without)});
  }
  return table;
}

/// True for names such as EA, EB, EC: rotations and squareness.
bool is_angle_error(std::string_view name) {
  constexpr std::string_view kRotations = "ABC";
  return name.size() > 1 && kRotations.find(name[1]) != std::string_view::npos;
}

struct PartOfBudget {
  const char* name;
  double mfb::Budget::*value;
};
constexpr std::array kPartsOfBudget{PartOfBudget{"u", &mfb::Budget::u},
                                    PartOfBudget{"probe", &mfb::Budget::probe},
                                    PartOfBudget{"machine", &mfb::Budget::machine},
                                    PartOfBudget{"bar", &mfb::Budget::bar},
                                    PartOfBudget{"expansion", &mfb::Budget::expansion},
                                    PartOfBudget{"temperature", &mfb::Budget::temperature},
                                    PartOfBudget{"roll", &mfb::Budget::roll},
                                    PartOfBudget{"of these: drift", &mfb::Budget::drift}};

/// A table of the uncertainty parts of all lengths, or of all angles. A part that is 0 for all
/// errors has no column.
Table budget_table(const std::vector<mfb::Budget>& budget, bool angles) {
  Table table{
      .title = fmt::format("Where the uncertainty comes from: {}", angles ? "angles" : "lengths"),
      .explanation =
          "Standard uncertainty (k = 1) of each error where it is largest, and its parts: noise of "
          "the probe, repeatability of the machine, calibration of the bar, its expansion "
          "coefficient, its temperature, its roll. The estimation of the drift adds the last part "
          "to those of probe and machine.",
      .columns = {angles ? "urad" : "um"},
      .rows = {}};
  for (const mfb::Budget& b : budget)
    if (is_angle_error(b.name) == angles) table.rows.push_back({b.name});

  for (const PartOfBudget& part : kPartsOfBudget) {
    if (std::ranges::all_of(budget, [&](const auto& b) { return b.*part.value == 0.0; })) continue;
    table.columns.emplace_back(part.name);
    std::size_t row = 0;
    for (const mfb::Budget& b : budget)
      if (is_angle_error(b.name) == angles)
        table.rows[row++].push_back(fmt::format("{:.3f}", b.*part.value * kUmPerM));
  }
  return table;
}

Table monte_carlo_table(const mfb::MonteCarlo& trials) {
  return {
      .title = "Monte Carlo check of the uncertainty",
      .explanation =
          "Trials of the whole chain from touches to errors: standard deviation of the trials "
          "relative to the standard uncertainty above.",
      .columns = {},
      .rows = {{"trials, seed", fmt::format("{}, {}", trials.trials, trials.seed)},
               {"mean, smallest, largest ratio",
                fmt::format("{:.3f}, {:.3f}, {:.3f}", trials.mean_ratio, trials.smallest_ratio,
                            trials.largest_ratio)},
               {"expected scatter of one ratio", fmt::format("{:.3f}", trials.scatter_of_ratio)}}};
}

/// Lowest and highest temperature of the bar in its measurements.
std::array<double, 2> temperatures_K(const mfb::Observations& o) {
  const auto [low, high] =
      std::ranges::minmax_element(o.passes, {}, &mfb::PassObservation::temperature_K);
  return {low->temperature_K, high->temperature_K};
}

Table bar_table(const MfbCandidate& candidate) {
  const mfb::Observations& o = candidate.found.observations;
  const auto [low_K, high_K] = temperatures_K(o);
  return {.title = "The Multi-Feature Bar",
          .explanation = {},
          .columns = {},
          .rows = {{"bar", fmt::format("{}, {} holes", o.bar.name, o.bar.pattern.holes())},
                   {"measurements",
                    fmt::format("{} in {} positions", o.passes.size(), o.positions.size())},
                   {"temperature as used", fmt::format("{:.2f} to {:.2f} C", low_K - kZeroCelsius_K,
                                                       high_K - kZeroCelsius_K)}}};
}

/// Table of the corrections of the calibrated points that the adjustment found; without rows if
/// there are none.
Table corrections_table(const MfbCandidate& candidate) {
  const mfb::Bar& bar = candidate.found.observations.bar;
  const Eigen::VectorXd& all = candidate.found.solution.bar_correction_m;
  Table table{.title = fmt::format("Corrections of bar \"{}\"", bar.name),
              .explanation =
                  "Of the calibrated points, within their uncertainty, as the adjustment found "
                  "them; x along the bar, z along the holes.",
              .columns = {"position along the bar, mm", "x, um", "y, um", "z, um"},
              .rows = {}};
  if (all.size() != 3 * std::ssize(bar.O_m)) return table;
  for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
    const calib::Vector3 c_um = kUmPerM * all.segment<3>(3 * static_cast<Eigen::Index>(i));
    table.rows.push_back({fmt::format("{:.1f}", kMmPerM * bar.pattern.hole_x_m[i]),
                          fmt::format("{:.3f}", c_um.x()), fmt::format("{:.3f}", c_um.y()),
                          fmt::format("{:.3f}", c_um.z())});
  }
  return table;
}

/// Names of the measurements, by position of the bar.
std::vector<std::string> measurements_of_positions(const mfb::Observations& o) {
  std::vector<std::string> names(o.positions.size());
  for (const mfb::PassObservation& pass : o.passes) {
    std::string& all = names[pass.position];
    all += (all.empty() ? "" : ", ") + o.plan.measurements[pass.measurement].name;
  }
  return names;
}

Table positions_table(const MfbCandidate& candidate) {
  const mfb::Observations& o = candidate.found.observations;
  Table table{.title = "Positions of the bar",
              .explanation = {},
              .columns = {"position", "measurements", "hole 1 beside the plan in X, Y, Z, mm"},
              .rows = {}};
  const auto measurements = measurements_of_positions(o);
  for (std::size_t p = 0; p < o.positions.size(); ++p) {
    const mfb::PositionOfBar& position = o.positions[p];
    const calib::Vector3 beside = (position.pose.origin_m - position.planned.origin_m) * kMmPerM;
    table.rows.push_back(
        {position.name, measurements[p],
         fmt::format("{:.2f}, {:.2f}, {:.2f}", beside.x(), beside.y(), beside.z())});
  }
  return table;
}

/// Adds the residuals at the calibrated points, in bar axes.
void add_residuals_of_passes(RunFigures& figures, const mfb::Solution& solution) {
  std::vector<std::string> names;
  std::vector<RunResidual> residuals;
  for (const mfb::PassResiduals& pass : solution.residuals) {
    for (std::size_t i = 0; i < pass.O_m.size(); ++i)
      for (Eigen::Index c = 0; c < 3; ++c)
        residuals.push_back({.part = names.size(),
                             .time_s = std::nullopt,
                             .before_m = pass.before_m[i](c),
                             .after_m = pass.O_m[i](c),
                             .sigma_m = pass.u_O_m[i](c)});
    names.push_back(pass.measurement);
  }
  add_residuals(figures, "measurement", names, residuals);
}

}  // namespace

RunFigures mfb_figures(const MfbCandidate& candidate) {
  const mfb::Solution& solution = candidate.found.solution;
  RunFigures figures = run_figures(candidate.verdict, "points");
  for (const mfb::BarPose& pose : solution.poses)
    figures.places_m.push_back(
        {pose.origin_m, pose.origin_m + pose.axes * candidate.found.observations.bar.O_m.back()});
  add_residuals_of_passes(figures, solution);

  figures.tables.push_back(bar_table(candidate));
  figures.tables.push_back(chi_square_table(candidate.found));
  if (!solution.budget.empty())
    for (const bool angles : {false, true})
      figures.tables.push_back(budget_table(solution.budget, angles));
  if (candidate.monte_carlo) figures.tables.push_back(monte_carlo_table(*candidate.monte_carlo));
  if (Table corrections = corrections_table(candidate); !corrections.rows.empty())
    figures.tables.push_back(std::move(corrections));
  figures.tables.push_back(positions_table(candidate));
  figures.conditions.emplace().bar_temperature_K = temperatures_K(candidate.found.observations);
  return figures;
}

}  // namespace abbe::daemon
