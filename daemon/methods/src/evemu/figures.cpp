#include "evemu/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/methods/run_figures.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;
using Table = RunFigures::Table;

Table rotation_table(const evemu::Solution& solution) {
  const auto& rotation = solution.rotation;
  const double u_urad = kUradPerRad * std::sqrt(rotation.cov_rad2.trace() / 3.0);
  Table table{
      .title = "The rotation that touches do not determine",
      .explanation =
          rotation.referenced
              ? "The rotation of the volume about Ball1 is referenced by an independent "
                "measurement."
              : "The machine measured the blocks of the artefact itself. A rotation of the blocks "
                "by the machine's own errors that is the same at all positions is not contained in "
                "the touches: the model is correct except for one rotation about Ball1. In a "
                "direct comparison with an independent measurement, nearly all of the error may "
                "seem to remain (for a machine with errors of 3 mm, R_resmag near 0.9, for every "
                "estimator); after a best-fit rotation about Ball1 only the shape is compared. "
                "Give a rotation reference, or accept \"evemu-shape-only\" in [gate].",
      .columns = {},
      .rows = {{"standard uncertainty of the rotation (in the model's covariance)",
                fmt::format("{:.1f} urad per axis", u_urad)},
               {"rotation removed from the estimate",
                fmt::format("{:.1f}, {:.1f}, {:.1f} urad", kUradPerRad * rotation.removed_rad.x(),
                            kUradPerRad * rotation.removed_rad.y(),
                            kUradPerRad * rotation.removed_rad.z())}}};
  if (const auto& reference = rotation.rotation_reference)
    table.rows.push_back(
        {"rotation reference",
         fmt::format("{} points; {} more points are outside the volume of the balls and were not "
                     "used. Chi-square of the residuals over the uncertainties of reference and "
                     "model: {:.1f} with {:.0f} degrees of freedom",
                     reference->points, reference->outside.size(), reference->chi2,
                     reference->dof)});
  return table;
}

std::string range_text(std::span<const double> values, double per_si, const char* unit) {
  const auto [least, most] = std::ranges::minmax(values);
  return least == most ? fmt::format("{:.2f} {}", per_si * most, unit)
                       : fmt::format("{:.2f} to {:.2f} {}", per_si * least, per_si * most, unit);
}

Table array_table(const evemu::ArtefactUncertainty& artefact) {
  Table table{
      .title = "The ball array",
      .explanation =
          "The errors of the array are the same at all positions: touches do not distinguish them "
          "from the errors of the machine. They are included in the model's covariance.",
      .columns = {},
      .rows = {{"standard uncertainty of a ball centre, per coordinate",
                range_text(artefact.u_ball_m, kUmPerM, "um")},
               {"of the direction of a block, about each axis across it",
                range_text(artefact.u_block_rad, kUradPerRad, "urad")}}};

  if (const auto& e = artefact.expansion) {
    table.rows.insert(
        table.rows.end(),
        {{"temperature", fmt::format("{:.3f} C, u = {:.3f} K", e->temperature_K - kZeroCelsius_K,
                                     e->u_temperature_K)},
         {"thermal expansion", fmt::format("{:.2f} um/(m K), u = {:.2f}", kUmPerM * e->alpha_per_K,
                                           kUmPerM * e->u_alpha_per_K)},
         {"expansion factor relative to 20 C",
          fmt::format("{:.9f}, u = {:.2g}", calib::expansion_factor(*e),
                      calib::u_expansion_factor(*e))}});
  } else {
    table.rows.push_back({"temperature", "not known; taken as 20 C"});
  }
  return table;
}

Table fit_table(const evemu::Solution& solution) {
  const evemu::Statistics& s = solution.statistics;
  return {.title = "The fit",
          .explanation =
              "Every position was left out once. At this position, each compared model was fitted "
              "with its own rotation about Ball1, because only the blocks determine the "
              "orientation of a position.",
          .columns = {},
          .rows = {
              {"artefact", fmt::format("{} positions, {} ball centres", s.positions, s.balls)},
              {"effective parameters", fmt::format("{:.1f}", s.effective_parameters)},
              {"noise of a ball centre, per coordinate", fmt::format("{:.2f} um", kUmPerM * s.s_m)},
              {"covariance", std::string(evemu::name(solution.covariance))}}};
}

Table poses_table(const evemu::Solution& solution) {
  Table table{.title = "Rotations of the positions",
              .explanation = fmt::format(
                  "The fit contains a rotation of each position about Ball1, for the measurement "
                  "error of its blocks: {:.1f} urad per axis, estimated from the data.",
                  kUradPerRad * solution.statistics.w_rad),
              .columns = {"position", "about x, urad", "about y, urad", "about z, urad"},
              .rows = {}};
  for (std::size_t p = 0; p < solution.pose_rotations_rad.size(); ++p) {
    const auto& r = solution.pose_rotations_rad[p];
    table.rows.push_back({std::to_string(p + 1), fmt::format("{:.1f}", kUradPerRad * r.x()),
                          fmt::format("{:.1f}", kUradPerRad * r.y()),
                          fmt::format("{:.1f}", kUradPerRad * r.z())});
  }
  return table;
}

Table choice_table(const evemu::SparseChoice& choice) {
  return {.title = "Choice of lambda and gamma",
          .explanation = "By cross-validation; cross_validation.csv has the error of every choice.",
          .columns = {},
          .rows = {{"lambda", fmt::format("{:.4g}", choice.lambda.back())},
                   {"gamma", fmt::format("{:.6g}", choice.gamma)},
                   {"smallest curvature along the last step (below 0: other solutions may be near)",
                    fmt::format("{:.3g}", choice.curvature)}}};
}

/// The readings at the balls, one polyline for each position of the array.
std::vector<std::vector<calib::Vector3>> places_of_balls(const evemu::Observations& observations) {
  std::vector<std::vector<calib::Vector3>> places;
  std::optional<int> position;
  for (const evemu::BallError& row : observations.rows) {
    if (position != row.position) places.emplace_back();
    position = row.position;
    places.back().push_back(row.reading_m);
  }
  return places;
}

/// Adds the residuals at the balls. Ball1 has none, because V is relative to Ball1.
void add_residuals_at_balls(RunFigures& figures, const evemu::Observations& observations,
                            const evemu::Solution& solution) {
  std::vector<std::string> names;
  std::vector<RunResidual> residuals;
  std::optional<int> position;
  for (std::size_t i = 0; i < observations.rows.size(); ++i) {
    const evemu::BallError& row = observations.rows[i];
    if (position != row.position) names.push_back(fmt::format("position {}", row.position));
    position = row.position;
    if (row.ball == 1) continue;
    for (Eigen::Index c = 0; c < 3; ++c)
      residuals.push_back({.part = names.size() - 1,
                           .time_s = std::nullopt,
                           .before_m = row.V_m(c),
                           .after_m = solution.residuals_m[i](c),
                           .sigma_m = solution.statistics.s_m});
  }
  add_residuals(figures, "position", names, residuals);
}

}  // namespace

RunFigures evemu_figures(const EvemuCandidate& candidate) {
  const evemu::Solution& solution = candidate.solution;
  RunFigures figures = run_figures(candidate.verdict, "positions");
  figures.places_m = places_of_balls(candidate.observations);
  add_residuals_at_balls(figures, candidate.observations, solution);
  figures.tables.push_back(rotation_table(solution));
  if (solution.artefact) figures.tables.push_back(array_table(*solution.artefact));
  figures.tables.push_back(fit_table(solution));
  if (!solution.pose_rotations_rad.empty()) figures.tables.push_back(poses_table(solution));
  if (solution.sparse) figures.tables.push_back(choice_table(*solution.sparse));
  // conditions without a temperature: ModelDocument::artefact has that of the array
  figures.conditions.emplace();
  return figures;
}

}  // namespace abbe::daemon
