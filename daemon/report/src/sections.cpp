#include "abbe/report/sections.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {
namespace {

/// Adds a table of the files and their hashes; nothing if there are no files.
void add_inputs(HtmlReport& page, const std::vector<InputFile>& inputs) {
  if (inputs.empty()) return;
  std::vector<std::vector<std::string>> rows;
  rows.reserve(inputs.size());
  for (const auto& input : inputs) rows.push_back({input.name, input.sha256});
  page.table({"input", "SHA-256"}, rows);
}

}  // namespace

std::string um_text(double length_m, int decimals) {
  return fmt::format("{:.{}f} um", length_m * kUmPerM, decimals);
}

void add_verdict(HtmlReport& page, const calib::Verdict& verdict, std::string_view held_out,
                 int decimals) {
  page.heading("Verdict");
  page.paragraph(verdict.accepted ? "The gate accepts the model." : "The gate refuses the model:");

  for (const auto& reason : verdict.reasons) page.paragraph(reason);
  for (const auto& note : verdict.notes) page.paragraph(note);
  const auto& figures = verdict.held_out;
  std::vector<std::pair<std::string, std::string>> facts{
      {fmt::format("error at {} excluded from the fit, without compensation", held_out),
       um_text(figures.no_compensation_rms_m, decimals) + " rms"},
      {"with the model", um_text(figures.candidate_rms_m, decimals) + " rms"},
      {"the same in standard deviations of the measurement (1: noise only)",
       fmt::format("{:.2f} without, {:.2f} with the model", figures.no_compensation,
                   figures.candidate)}};
  if (figures.active_rms_m)
    facts.emplace_back("with the model active so far, within its validity volume",
                       um_text(*figures.active_rms_m, decimals) + " rms");
  facts.emplace_back("largest error in the volume", um_text(verdict.max_error_m, decimals));
  page.facts(facts);
}

void add_model_origin(HtmlReport& page, const ModelDocument& document,
                      const std::vector<InputFile>& inputs,
                      const std::vector<std::pair<std::string, std::string>>& more) {
  page.heading("Model");
  std::vector<std::pair<std::string, std::string>> facts{
      {"machine", document.machine},
      {"kinematic chain (ISO 10791-6)", document.model.chain().text()},
      {"model", model_id(document)},
      {"method",
       fmt::format("{}{}, {}", document.method,
                   document.mode.empty() ? "" : " (" + document.mode + ")", document.estimator)},
      {"gauge", std::string{calib::name(document.model.gauge())}},
      {"created (UTC)", to_text(document.created)}};
  facts.insert(facts.end(), more.begin(), more.end());
  page.facts(facts);
  add_inputs(page, inputs);
}

}  // namespace abbe::daemon
