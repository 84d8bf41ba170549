#include "report/sections.hpp"

#include <fmt/format.h>

#include <utility>

#include "units.hpp"

namespace abbe::daemon {
namespace {}  // namespace

std::string um_text(double length_m, int decimals) {
  return fmt::format("{:.{}f} um", length_m * kUmPerM, decimals);
}

std::vector<double> in_um(const std::vector<double>& lengths_m) {
  std::vector<double> out;
  out.reserve(lengths_m.size());
  for (const double m : lengths_m) out.push_back(m * kUmPerM);
  return out;
}

void add_verdict(HtmlReport& page, const calib::Verdict& verdict, std::string_view held_out, int decimals) {
  page.heading("Verdict");
  page.paragraph(verdict.accepted ? "The gate accepts the model." : "The gate refuses the model:");
  for (const auto& reason : verdict.reasons) page.paragraph(reason);
  for (const auto& note : verdict.notes) page.paragraph(note);
  const auto& figures = verdict.held_out;
  std::vector<std::pair<std::string, std::string>> facts{
      {fmt::format("left at {} the fit did not see, without compensation", held_out),
       um_text(figures.no_compensation_rms_m, decimals) + " rms"},
      {"with the model", um_text(figures.candidate_rms_m, decimals) + " rms"},
      {"the same in standard deviations of the measurement (1: noise alone)",
       fmt::format("{:.2f} without, {:.2f} with the model", figures.no_compensation, figures.candidate)}};
  if (figures.active_rms_m)
    facts.emplace_back("with the model active until now, where it holds",
                       um_text(*figures.active_rms_m, decimals) + " rms");
  facts.emplace_back("largest error in the volume", um_text(verdict.max_error_m, decimals));
  page.facts(facts);
}

void add_inputs(HtmlReport& page, const std::vector<InputFile>& inputs) {
  if (inputs.empty()) return;
  std::vector<std::vector<std::string>> rows;
  for (const auto& input : inputs) rows.push_back({input.name, input.sha256});
  page.table({"input", "SHA-256"}, rows);
}

}  // namespace abbe::daemon
