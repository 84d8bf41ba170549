#include "abbe/methods/evemu/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/report/html_report.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/sections.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;

void add_verdict(HtmlReport& page, const calib::Verdict& verdict) {
  add_verdict(page, verdict, "positions");
  page.paragraph(
      "Every position was left out once. At this position, each compared model was fitted with its "
      "own rotation about Ball1, because only the blocks determine the orientation of a position.");
}

void add_rotation(HtmlReport& page, const evemu::Solution& solution) {
  page.heading("The rotation that touches do not determine");
  const auto& rotation = solution.rotation;
  const double u_urad = kUradPerRad * std::sqrt(rotation.cov_rad2.trace() / 3.0);
  page.paragraph(
      rotation.referenced
          ? "The rotation of the volume about Ball1 is referenced by an independent measurement."
          : "The machine measured the blocks of the artefact itself. A rotation of the blocks by "
            "the machine's own errors that is the same at all positions is not contained in the "
            "touches: the model is correct except for one rotation about Ball1. In a direct "
            "comparison with an independent measurement, nearly all of the error may seem to "
            "remain (for a machine with errors of 3 mm, R_resmag near 0.9, for every estimator); "
            "after a best-fit rotation about Ball1 only the shape is compared. Give a rotation "
            "reference, or accept \"evemu-shape-only\" in [gate].");

  if (rotation.reference) {
    page.paragraph(
        fmt::format("Rotation reference: {} points; {} more points are outside the volume of the "
                    "balls and were not used. Chi-square of the residuals over the uncertainties "
                    "of reference and model: {:.1f} with {:.0f} degrees of freedom.",
                    rotation.reference->points, rotation.reference->outside.size(),
                    rotation.reference->chi2, rotation.reference->dof));
  }

  page.facts({{"standard uncertainty of the rotation (in the model's covariance)",
               fmt::format("{:.1f} urad per axis", u_urad)},
              {"rotation removed from the estimate",
               fmt::format("{:.1f}, {:.1f}, {:.1f} urad", kUradPerRad * rotation.removed_rad.x(),
                           kUradPerRad * rotation.removed_rad.y(),
                           kUradPerRad * rotation.removed_rad.z())}});
}

std::string range_text(std::span<const double> values, double per_si, const char* unit) {
  const auto [least, most] = std::ranges::minmax(values);
  return least == most ? fmt::format("{:.2f} {}", per_si * most, unit)
                       : fmt::format("{:.2f} to {:.2f} {}", per_si * least, per_si * most, unit);
}

void add_array(HtmlReport& page, const evemu::ArtefactUncertainty& artefact) {
  page.heading("The ball array");
  page.paragraph(
      "The errors of the array are the same at all positions: touches do not distinguish them from "
      "the errors of the machine. They are included in the model's covariance.");
  std::vector<std::pair<std::string, std::string>> facts{
      {"standard uncertainty of a ball centre, per coordinate",
       range_text(artefact.u_ball_m, kUmPerM, "um")},
      {"of the direction of a block, about each axis across it",
       range_text(artefact.u_block_rad, kUradPerRad, "urad")}};

  if (const auto& e = artefact.expansion) {
    facts.insert(
        facts.end(),
        {{"temperature", fmt::format("{:.3f} C, u = {:.3f} K", e->temperature_K - kZeroCelsius_K,
                                     e->u_temperature_K)},
         {"thermal expansion", fmt::format("{:.2f} um/(m K), u = {:.2f}", kUmPerM * e->alpha_per_K,
                                           kUmPerM * e->u_alpha_per_K)},
         {"expansion factor relative to 20 C",
          fmt::format("{:.9f}, u = {:.2g}", calib::expansion_factor(*e),
                      calib::u_expansion_factor(*e))}});
  } else {
    facts.emplace_back("temperature", "not known; taken as 20 C");
  }

  page.facts(facts);
}

/// Components, in um, of the errors V (`before`) or of the residuals at all balls except Ball1.
std::vector<double> components_um(const evemu::Observations& o, const evemu::Solution& solution,
                                  bool before) {
  std::vector<double> out;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    if (o.rows[i].ball == 1) continue;
    const calib::Vector3& v = before ? o.rows[i].V_m : solution.residuals_m[i];
    for (const double component : v) out.push_back(component * kUmPerM);
  }
  return out;
}

void add_residuals(HtmlReport& page, const evemu::Observations& o,
                   const evemu::Solution& solution) {
  page.heading("Residuals at the balls");
  const auto row = [](const char* what, const evemu::ResidualFigures& f) {
    return std::vector<std::string>{what, um_text(f.mean_abs_m), um_text(f.rms_m),
                                    um_text(f.max_abs_m)};
  };

  page.table({"", "mean", "rms", "largest"}, {row("errors", solution.statistics.before),
                                              row("residuals", solution.statistics.after)});
  page.chart(Histogram{
      "before", "error of a component, um", {{"before", components_um(o, solution, true)}}});
  page.chart(Histogram{
      "after", "residual of a component, um", {{"after", components_um(o, solution, false)}}});
  constexpr std::array<const char*, 3> kNames{"x", "y", "z"};

  for (Eigen::Index c = 0; c < 3; ++c) {
    LineChart chart;
    chart.title = fmt::format("residuals in {}", kNames[static_cast<std::size_t>(c)]);
    chart.x_label = "ball";
    chart.y_label = "um";
    for (std::size_t i = 0; i < o.rows.size(); ++i) {
      const auto name = fmt::format("position {}", o.rows[i].position);
      if (chart.curves.empty() || chart.curves.back().name != name)
        chart.curves.push_back({.name = name, .x = {}, .y = {}});
      chart.curves.back().x.push_back(o.rows[i].ball);
      chart.curves.back().y.push_back(solution.residuals_m[i](c) * kUmPerM);
    }
    page.chart(chart);
  }
}

void add_poses(HtmlReport& page, const evemu::Solution& solution) {
  if (solution.pose_rotations_rad.empty()) return;
  page.heading("Rotations of the positions");
  page.paragraph(fmt::format(
      "The fit contains a rotation of each position about Ball1, for the measurement error of its "
      "blocks: {:.1f} urad per axis, estimated from the data.",
      kUradPerRad * solution.statistics.w_rad));
  std::vector<std::vector<std::string>> rows;

  for (std::size_t p = 0; p < solution.pose_rotations_rad.size(); ++p) {
    const auto& r = solution.pose_rotations_rad[p];
    rows.push_back({std::to_string(p + 1), fmt::format("{:.1f}", kUradPerRad * r.x()),
                    fmt::format("{:.1f}", kUradPerRad * r.y()),
                    fmt::format("{:.1f}", kUradPerRad * r.z())});
  }

  page.table({"position", "about x, urad", "about y, urad", "about z, urad"}, rows);
}

void add_choice(HtmlReport& page, const evemu::SparseChoice& choice) {
  page.heading("Choice of lambda and gamma");
  page.facts({{"lambda", fmt::format("{:.4g}", choice.lambda.back())},
              {"gamma", fmt::format("{:.6g}", choice.gamma)},
              {"smallest curvature along the last step (below 0: other solutions may be near)",
               fmt::format("{:.3g}", choice.curvature)}});
  LineChart chart{
      "cross-validation", "log10 lambda", "log10 of the mean squared held-out error, mm^2", {}};
  constexpr std::size_t kShown = 6;
  const std::size_t gammas = choice.all_gamma.size();
  const std::size_t step = std::max<std::size_t>(1, gammas / kShown);

  for (std::size_t g = 0; g < gammas; ++g) {
    if (g % step != 0 && choice.all_gamma[g] != choice.gamma) continue;
    Curve curve{fmt::format("gamma {:.4g}", choice.all_gamma[g]), {}, {}, {}};
    for (std::size_t l = 0; l < choice.all_lambda.size(); ++l) {
      const double e = choice.error_mm2(static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(g));
      if (!(e > 0.0)) continue;
      curve.x.push_back(std::log10(choice.all_lambda[l]));
      curve.y.push_back(std::log10(e));
    }
    chart.curves.push_back(std::move(curve));
  }

  page.chart(chart);
}

void add_coefficients(HtmlReport& page, const evemu::EvemuModel& model,
                      const evemu::Solution& solution) {
  page.heading("Coefficients of the equivalent model");
  page.paragraph(
      fmt::format("Names of Li et al., Table 3; covariance {}.", evemu::name(solution.covariance)));
  std::vector<std::vector<std::string>> rows;
  for (const auto& c : model.named_coefficients())
    rows.push_back({c.name, fmt::format("{:.6g}", c.value), fmt::format("{:.2g}", c.u), c.unit});
  page.table({"", "value", "u", "unit"}, rows);
}

/// Adds charts of V along three lines through the centre of the volume, one parallel to each axis.
/// A chart shows only the part inside the model's validity volume.
void add_sections(HtmlReport& page, const calib::VolumetricModel& model) {
  page.heading("V through the middle of the volume");
  page.paragraph("Bands: expanded uncertainty U = 2 u (coverage factor k = 2).");
  const auto& box = model.polynomials()->design().box();
  const calib::Vector3 tool = model.tool_offsets_m().front();
  constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
  constexpr int kSteps = 40;

  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    LineChart chart{fmt::format("along {}", kNames[static_cast<std::size_t>(axis)]),
                    fmt::format("{}, mm", kNames[static_cast<std::size_t>(axis)]),
                    "error, um",
                    {{.name = "V x", .x = {}, .y = {}},
                     {.name = "V y", .x = {}, .y = {}},
                     {.name = "V z", .x = {}, .y = {}}}};
    for (int k = 0; k <= kSteps; ++k) {
      calib::Vector3 q = box.centre_m;
      q(axis) += box.half_width_m(axis) * (2.0 * k / kSteps - 1.0);
      const auto e = model.error_at(q, tool);
      if (!e.inside) continue;
      for (Eigen::Index c = 0; c < 3; ++c) {
        Curve& curve = chart.curves[static_cast<std::size_t>(c)];
        curve.x.push_back(q(axis) * kMmPerM);
        curve.y.push_back(e.V_m(c) * kUmPerM);
        curve.u.push_back(std::sqrt(e.cov_V_m2(c, c)) * kUmPerM);
      }
    }
    page.chart(chart);
  }
}

void add_origin(HtmlReport& page, const ModelDocument& document, const evemu::Solution& solution) {
  const auto& s = solution.statistics;
  add_model_origin(
      page, document, document.inputs,
      {{"artefact", fmt::format("{} positions, {} ball centres", s.positions, s.balls)},
       {"observations",
        fmt::format("{} for {} coefficients, rank {}, condition {:.3g}, {:.1f} effective "
                    "parameters",
                    s.observations, s.unknowns, s.rank, s.condition, s.effective_parameters)},
       {"noise of a ball centre, per coordinate", um_text(s.s_m)},
       {"chi^2 per degree of freedom", fmt::format("{:.3f}", s.chi2_per_dof)},
       {"valid", "inside the hull of the ball centres, for one tool"}});
}

}  // namespace

std::string evemu_report(const ModelDocument& document, const evemu::Observations& observations,
                         const evemu::Solution& solution, const calib::Verdict& verdict) {
  HtmlReport page(fmt::format("{}: calibration with a ball array", document.machine));
  add_verdict(page, verdict);
  add_rotation(page, solution);
  if (solution.artefact) add_array(page, *solution.artefact);
  add_residuals(page, observations, solution);
  add_poses(page, solution);
  if (solution.sparse) add_choice(page, *solution.sparse);
  add_sections(page, document.model);
  add_volume_maps(page, document.model);
  add_coefficients(page, *document.model.polynomials(), solution);
  add_origin(page, document, solution);
  return page.text();
}

}  // namespace abbe::daemon
