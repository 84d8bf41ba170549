#include <fmt/format.h>

#include "abbe/base/utc_text.hpp"
#include "abbe/report/model_words.hpp"
#include "report_sections.hpp"
#include "stated_conditions.hpp"

namespace abbe::daemon {
namespace {

using Facts = std::vector<std::pair<std::string, std::string>>;

void add_if(Facts& facts, std::string what, const std::string& text) {
  if (!text.empty()) facts.emplace_back(std::move(what), text);
}

std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts)
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  return text;
}

std::string contact_text(const Contact& contact) {
  return joined({contact.name, contact.street, contact.post_code, contact.city, contact.country,
                 contact.email});
}

/// The user who added the model to the store; empty for a file.
std::string operator_of(const ReportSubject& subject) {
  for (const StoreEvent& event : subject.events)
    if (event.action == StoreAction::Added)
      return fmt::format("{}, {} (UTC)", event.actor.who, to_text(event.actor.when));
  return {};
}

void add_conditions(Facts& facts, const ReportSubject& subject) {
  for (const StatedCondition& condition : stated_conditions(subject.document, subject.details))
    facts.emplace_back(condition.name, in_words(condition));
  facts.emplace_back("tool offsets", tools_in_words(subject.document.model));
}

/// The settings of the measuring devices as text: "tracker.reflector = A; tracker.weather =
/// compute".
std::string measured_with(const ModelDocument& document) {
  if (!document.configuration) return {};
  std::string text;
  for (const auto& [key, value] : document.configuration->measurements)
    text += fmt::format("{}{} = {}", text.empty() ? "" : "; ", key, value);
  return text;
}

Facts facts_of(const ReportSubject& subject) {
  const CertificateDetails& d = subject.details;
  const ModelDocument& document = subject.document;
  Facts facts;
  add_if(facts, "certificate", d.number);
  facts.emplace_back("machine", document.machine);
  add_if(facts, "machine_id", subject.machine_id);
  add_if(facts, "manufacturer, model, serial number",
         joined({d.machine_manufacturer, d.machine_model, d.machine_serial}));
  facts.emplace_back("kinematic chain (ISO 10791-6)", document.model.chain().text());
  facts.emplace_back("model", fmt::format("{}, hash {}", model_id(document), model_hash(document)));
  facts.emplace_back("hash of the machine configuration", document.machine_hash);
  facts.emplace_back("devices", devices_in_words(made_on_simulated_devices(document)));
  add_if(facts, "settings of the measuring devices", measured_with(document));
  facts.emplace_back("method", method_in_words(document));
  if (const auto measured = measured_of(document))
    facts.emplace_back("measured (UTC)", fmt::format("{} to {}", to_seconds((*measured)[0]),
                                                     to_seconds((*measured)[1])));
  facts.emplace_back("identified (UTC)", to_text(document.created));
  add_if(facts, "measurement from, to", joined({d.begin_date, d.end_date}));
  add_if(facts, "operator", operator_of(subject));
  add_if(facts, "laboratory", joined({contact_text(d.laboratory), d.laboratory_code}));
  add_if(facts, "customer", contact_text(d.customer));
  for (const EquipmentDetails& e : d.equipment)
    if (is_used(e, EquipmentUse::AsFound))
      facts.emplace_back("equipment",
                         joined({e.name, e.manufacturer, e.model, e.serial, e.certificate,
                                 e.valid_until.empty() ? "" : "valid until " + e.valid_until}));
  add_conditions(facts, subject);
  add_if(facts, "remark", d.remark);
  facts.emplace_back(
      "software",
      fmt::format("abbe {}; this report: abbe {}",
                  document.software.empty() ? ABBE_VERSION : document.software, ABBE_VERSION));
  return facts;
}

Facts statistics_of(const ModelDocument& document) {
  const ModelStatistics& s = document.statistics;
  Facts facts;
  if (!is_joint(document))
    facts.emplace_back("samples", fmt::format("{}, {} lost", s.samples, s.lost_samples));
  facts.emplace_back("observations", fmt::format("{} for {} unknowns, rank {}, condition {:.3g}",
                                                 s.observations, s.unknowns, s.rank, s.condition));
  facts.emplace_back(is_joint(document) ? "held-out legs: rms and mean square of residuals divided "
                                          "by their uncertainty"
                                        : "sigma0, chi-square per degree of freedom",
                     fmt::format("{:.3f}, {:.3f}", s.sigma0, s.chi2_per_dof));
  facts.emplace_back("variance factor (multiplies the covariance)",
                     fmt::format("{:.3f}", s.variance_factor));
  return facts;
}

}  // namespace

void add_origin_of(HtmlReport& page, const ReportSubject& subject) {
  page.heading("Origin and conditions");
  page.facts(facts_of(subject));
  if (const std::string whose = whose_residuals(subject.document); !whose.empty())
    page.paragraph(whose);
  page.facts(statistics_of(subject.document));
  std::vector<std::vector<std::string>> rows;
  for (const InputFile& input : subject.document.inputs) rows.push_back({input.name, input.sha256});
  if (!rows.empty()) page.table({"input", "SHA-256"}, rows);
}

}  // namespace abbe::daemon
