#include "certificate_file.hpp"

#include "abbe/base/text_file.hpp"
#include "abbe/result/try.hpp"
#include "abbe/settings/bounded_toml.hpp"
#include "abbe/settings/section.hpp"

namespace abbe::daemon {
namespace {

/// Reads a date, "2026-11-26".
void read_date(Section& section, std::string_view key, std::string& out) {
  if (section.get(key, out) && !is_date(out))
    section.fault(key, "must be a date such as \"2026-11-26\"");
}

void read_contact(Section contact, Contact& out) {
  contact.get("name", out.name);
  contact.get("street", out.street);
  contact.get("post_code", out.post_code);
  contact.get("city", out.city);
  contact.get("email", out.email);
  if (contact.get("country", out.country) && !is_country_code(out.country))
    contact.fault("country", "must be two capital letters (ISO 3166-1), such as \"DE\"");
  contact.close();
}

void read_number(Section& section, std::string_view key, std::optional<double>& out,
                 Bounds bounds) {
  double value = 0.0;
  if (section.get(key, value, kPlain, bounds)) out = value;
}

void read_certificate(Section section, CertificateDetails& out) {
  section.get("number", out.number);
  read_date(section, "begin_date", out.begin_date);
  read_date(section, "end_date", out.end_date);
  read_date(section, "issue_date", out.issue_date);
  section.get_word("location", out.location,
                   std::vector<std::pair<std::string_view, std::string>>{
                       {"laboratory", "laboratory"},
                       {"customer", "customer"},
                       {"laboratoryBranch", "laboratoryBranch"},
                       {"customerBranch", "customerBranch"},
                       {"other", "other"}});
  section.get("remark", out.remark);
  section.close();
}

void read_conditions(Section section, CertificateDetails& out) {
  read_number(section, "temperature_C", out.temperature_C, {-50.0, 100.0});
  read_number(section, "u_temperature_K", out.u_temperature_K, {0.0, 50.0});
  if (out.u_temperature_K && !out.temperature_C)
    section.fault("u_temperature_K", "needs temperature_C");
  read_number(section, "humidity_percent", out.humidity_percent, {0.0, 100.0});
  read_number(section, "feed_mm_per_min", out.feed_mm_per_min, {0.0, 1e6});
  section.close();
}

void read_equipment(Section& root, CertificateDetails& out) {
  for (Section& section : root.children("equipment")) {
    EquipmentDetails& e = out.equipment.emplace_back();
    section.get("name", e.name, Need::Required);
    section.get("manufacturer", e.manufacturer);
    section.get("model", e.model);
    section.get("serial", e.serial);
    section.get("certificate", e.certificate);
    read_date(section, "valid_until", e.valid_until);
    section.get_word("used", e.use,
                     std::vector<std::pair<std::string_view, EquipmentUse>>{
                         {"as-found", EquipmentUse::AsFound},
                         {"as-left", EquipmentUse::AsLeft},
                         {"both", EquipmentUse::Both},
                         {"verification", EquipmentUse::Verification}});
    section.close();
  }
}

void read_tolerances(Section& root, CertificateDetails& out) {
  for (Section& section : root.children("tolerance")) {
    ToleranceDetails& t = out.tolerances.emplace_back();
    section.get("value", t.value, Need::Required);
    double limit_um = 0.0, limit_urad = 0.0;
    section.get("limit_um", limit_um, kPlain, kPositive);
    section.get("limit_urad", limit_urad, kPlain, kPositive);
    t.is_angle = section.has("limit_urad");
    if (section.has("limit_um") == t.is_angle)
      section.fault("value", "needs one limit: limit_um of a length, limit_urad of an angle");
    t.limit_um_urad = t.is_angle ? limit_urad : limit_um;
    section.close();
  }
}

void read_verification(Section section, VerificationDetails& out) {
  read_date(section, "date", out.date);
  section.get("operator", out.operator_name);
  read_number(section, "temperature_C", out.temperature_C, {-50.0, 100.0});
  read_number(section, "u_um", out.u_um, kPositive);
  read_number(section, "limit_rms_um", out.limit_rms_um, kPositive);
  read_number(section, "limit_max_um", out.limit_max_um, kPositive);

  for (const std::string_view limit : {"limit_rms_um", "limit_max_um"}) {
    if (!section.has(limit)) continue;
    if (!section.has("u_um"))
      section.fault(limit, "needs u_um, the standard uncertainty of a measured coordinate");
    if (!section.has("date")) section.fault(limit, "needs date, the day of the measurement");
  }
  section.close();
}

}  // namespace

Result<CertificateDetails> read_certificate_toml(const std::filesystem::path& file) {
  const auto text = read_regular_file(file);
  ABBE_TRY(text);
  const auto table = parse_toml(*text, file.string());
  ABBE_TRY(table);

  Faults faults(file.string());
  Section root(&*table, "", {1, 1}, faults);
  CertificateDetails details;
  read_certificate(root.child("certificate"), details);
  Section laboratory = root.child("laboratory");
  laboratory.get("code", details.laboratory_code);
  read_contact(std::move(laboratory), details.laboratory);
  read_contact(root.child("customer"), details.customer);
  Section person = root.child("person"), machine = root.child("machine");
  person.get("name", details.person);
  person.get("role", details.role);
  person.close();
  machine.get("manufacturer", details.machine_manufacturer);
  machine.get("model", details.machine_model);
  machine.get("serial", details.machine_serial);
  machine.close();
  read_conditions(root.child("conditions"), details);
  read_equipment(root, details);
  read_tolerances(root, details);
  read_verification(root.child("verification"), details.verification);
  root.close();

  if (faults.any()) return tl::make_unexpected(faults.to_error());
  return details;
}

}  // namespace abbe::daemon
