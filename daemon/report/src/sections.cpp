#include "abbe/report/sections.hpp"

#include <fmt/format.h>

#include "abbe/base/local_time.hpp"
#include "abbe/base/units.hpp"

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

std::string shortened(std::string text) {
  constexpr std::size_t kMost = 90;
  if (text.size() <= kMost) return text;
  std::size_t end = kMost;
  // the text must not be cut within a UTF-8 character
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  return text.substr(0, end) + " ...";
}

void add_footer(HtmlReport& page, const ModelDocument& document) {
  page.footer(fmt::format("model {} hash {}", model_id(document), model_hash(document)));
}

std::string stated(const std::string& text, std::string_view key) {
  return text.empty() ? fmt::format("not stated ({})", key) : shortened(text);
}

std::string instruments_of(const CertificateDetails& details, EquipmentUse use) {
  std::string text;
  for (const EquipmentDetails& e : details.equipment) {
    if (!is_used(e, use)) continue;
    if (!text.empty()) text += ", ";
    text += e.serial.empty() ? e.name : e.name + " " + e.serial;
  }
  return text;
}

std::string signed_by(const CertificateDetails& details) {
  return details.role.empty() ? details.person : details.person + ", " + details.role;
}

void add_signature(HtmlReport& page, const std::string& name, const std::string& date) {
  const std::string line(28, '_');
  page.heading("Signature");
  page.table({"name", "date", "signature"},
             {{name.empty() ? line : shortened(name), date.empty() ? line : date, line}});
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
      {"datum", std::string{calib::name(document.model.datum())}},
      {"created", local_time_text(document.created)}};
  facts.insert(facts.end(), more.begin(), more.end());
  page.facts(facts);
  add_inputs(page, inputs);
}

}  // namespace abbe::daemon
