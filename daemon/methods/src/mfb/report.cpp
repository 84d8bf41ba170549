#include "abbe/methods/mfb/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/units.hpp"
#include "abbe/methods/otf/report.hpp"
#include "abbe/report/html_report.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/sections.hpp"
#include "mfb/pass_figures.hpp"

namespace abbe::daemon {

namespace mfb = calib::mfb;

namespace {

void add_chi_square(HtmlReport& page, const mfb::Identification& found) {
  const mfb::Statistics& s = found.solution.statistics;
  page.heading("Chi-square");
  std::vector<std::pair<std::string, std::string>> facts{
      {"per degree of freedom (1: residuals as large as the stated noise)",
       fmt::format("{:.3f}, at most {:.3f}", s.chi2_per_dof, s.chi2_per_dof_limit)},
      {"chi-square, degrees of freedom",
       fmt::format("{:.1f}, {:.1f}", s.chi2, s.degrees_of_freedom)},
      {"with the corrections of the bar and of other values that have a stated uncertainty, per "
       "degree of freedom",
       fmt::format("{:.3f}, at most {:.3f}", s.all_chi2_per_dof, s.all_chi2_per_dof_limit)}};
  if (found.cause.cause != mfb::Cause::None) {
    facts.emplace_back("likely cause", found.cause.text);
    facts.emplace_back("per degree of freedom with this cause taken into account",
                       fmt::format("{:.3f}", found.cause.chi2_per_dof_without));
  }
  page.facts(facts);
}

/// EA, EB, EC: rotations and squareness.
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

/// A table of the lengths or of the angles. A part that is 0 for all errors has no column.
void add_budget_of(HtmlReport& page, const std::vector<mfb::Budget>& budget, bool angles) {
  std::vector<std::string> columns{angles ? "urad" : "um"};
  std::vector<std::vector<std::string>> rows;
  for (const mfb::Budget& b : budget)
    if (is_angle_error(b.name) == angles) rows.push_back({b.name});

  for (const PartOfBudget& part : kPartsOfBudget) {
    if (std::ranges::all_of(budget, [&](const auto& b) { return b.*part.value == 0.0; })) continue;
    columns.emplace_back(part.name);
    std::size_t row = 0;
    for (const mfb::Budget& b : budget)
      if (is_angle_error(b.name) == angles)
        rows[row++].push_back(fmt::format("{:.3f}", b.*part.value * kUmPerM));
  }
  page.table(columns, rows);
}

void add_budget(HtmlReport& page, const std::vector<mfb::Budget>& budget) {
  if (budget.empty()) return;
  page.heading("Where the uncertainty comes from");
  page.paragraph(
      "Standard uncertainty (k = 1) of each error where it is largest, and its parts: noise of the "
      "probe, repeatability of the machine, calibration of the bar, its expansion coefficient, its "
      "temperature, its roll. The estimation of the drift adds the last part to those of probe and "
      "machine.");
  add_budget_of(page, budget, false);
  add_budget_of(page, budget, true);
}

void add_monte_carlo(HtmlReport& page, const std::optional<mfb::MonteCarlo>& trials) {
  if (!trials) return;
  page.heading("Monte Carlo check of the uncertainty");
  page.paragraph(fmt::format(
      "{} trials of the whole chain from touches to errors, seed {}. Standard deviation of the "
      "trials relative to the standard uncertainty above: {:.3f} in the mean, {:.3f} to {:.3f} "
      "(expected scatter of one value: {:.3f}).",
      trials->trials, trials->seed, trials->mean_ratio, trials->smallest_ratio,
      trials->largest_ratio, trials->scatter_of_ratio));
}

void add_origin_with_bar(HtmlReport& page, const ModelDocument& document,
                         const MfbCandidate& candidate) {
  const mfb::Observations& o = candidate.found.observations;
  const auto& s = document.statistics;
  add_model_origin(
      page, document, document.inputs,
      {{"bar", fmt::format("{}, {} holes", o.bar.name, o.bar.pattern.holes())},
       {"measurements",
        fmt::format("{} in {} positions, {} touches used, {} excluded", o.passes.size(),
                    o.positions.size(), s.samples, s.lost_samples)},
       {"observations", fmt::format("{} for {} unknowns, rank {}, condition {:.3g}", s.observations,
                                    s.unknowns, s.rank, s.condition)}});
}

}  // namespace

std::string mfb_report(const ModelDocument& document, const MfbCandidate& candidate) {
  HtmlReport page(fmt::format("{}: calibration with a Multi-Feature Bar", document.machine));
  add_verdict(page, candidate.verdict, "points", 3);
  add_chi_square(page, candidate.found);
  add_error_tables(page, document.model);
  add_budget(page, candidate.found.solution.budget);
  add_monte_carlo(page, candidate.monte_carlo);
  add_residuals_along_bar(page, candidate);
  add_touches_set_aside(page, candidate);
  add_drift_of_passes(page, candidate);
  add_positions_of_bar(page, candidate);
  add_volume_maps(page, document.model);
  add_origin_with_bar(page, document, candidate);
  return page.text();
}

}  // namespace abbe::daemon
