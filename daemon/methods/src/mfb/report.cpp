#include "abbe/methods/mfb/report.hpp"

#include <fmt/format.h>

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
       fmt::format("{:.1f}, {:.1f}", s.chi2, s.degrees_of_freedom)}};
  if (found.cause.cause != mfb::Cause::None) {
    facts.emplace_back("likely cause", found.cause.text);
    facts.emplace_back("per degree of freedom with this cause taken into account",
                       fmt::format("{:.3f}", found.cause.chi2_per_dof_without));
  }
  page.facts(facts);
}

/// Squareness errors and the names that begin with EA, EB, EC are angles.
bool is_angle_error(std::string_view name) {
  constexpr std::string_view kRotations = "ABC";
  return name.size() > 1 && kRotations.find(name[1]) != std::string_view::npos;
}

void add_budget(HtmlReport& page, const std::vector<mfb::Budget>& budget) {
  if (budget.empty()) return;
  page.heading("Where the uncertainty comes from");
  page.paragraph(
      "Standard uncertainty (k = 1) of each error where it is largest, and the parts of it: noise "
      "of the probe, repeatability of the machine, calibration of the bar, its expansion "
      "coefficient, its temperature, its roll. The estimation of the drift adds the last part to "
      "those of probe and machine.");
  std::vector<std::vector<std::string>> rows;
  for (const mfb::Budget& b : budget) {
    std::vector<std::string> row{
        fmt::format("{}, {}", b.name, is_angle_error(b.name) ? "urad" : "um")};
    for (const double part :
         {b.u, b.probe, b.machine, b.bar, b.expansion, b.temperature, b.roll, b.drift})
      row.push_back(fmt::format("{:.3f}", part * kUmPerM));
    rows.push_back(std::move(row));
  }
  page.table(
      {"", "u", "probe", "machine", "bar", "expansion", "temperature", "roll", "of these: drift"},
      rows);
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
        fmt::format("{} in {} positions, {} touches used, {} set aside", o.passes.size(),
                    o.positions.size(), s.samples, s.lost_samples)},
       {"observations", fmt::format("{} for {} unknowns, rank {}, condition {:.3g}", s.observations,
                                    s.unknowns, s.rank, s.condition)}});
}

}  // namespace

std::string mfb_report(const ModelDocument& document, const MfbCandidate& candidate) {
  HtmlReport page(fmt::format("{}: calibration with a Multi-Feature Bar", document.machine));
  add_verdict(page, candidate.verdict, "measurements", 3);
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
