#include "abbe/report/calibration_certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "abbe/report/model_words.hpp"
#include "abbe/result/try.hpp"
#include "certificate_dates.hpp"
#include "certificate_parts.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

/// The missing entries, without which a certificate is not valid.
std::vector<std::string> missing_entries(const ReportSubject& subject,
                                         const ReportSubject* as_left) {
  const CertificateDetails& d = subject.details;
  std::vector<std::string> missing;
  const auto require = [&missing](bool present, const char* what) {
    if (!present) missing.emplace_back(what);
  };
  require(!xml_text(d.number).empty(), "certificate.number");
  require(!xml_text(d.laboratory.name).empty(), "laboratory.name");
  require(!xml_text(d.laboratory.city).empty(), "laboratory.city");
  require(is_country_code(d.laboratory.country),
          "laboratory.country: two capital letters, such as DE");
  require(!xml_text(d.customer.name).empty(), "customer.name");
  require(!xml_text(d.customer.city).empty(), "customer.city");
  require(d.customer.country.empty() || is_country_code(d.customer.country),
          "customer.country: two capital letters, such as DE");
  require(!xml_text(d.person).empty(), "person.name");
  require(!xml_text(d.machine_serial).empty(), "machine.serial");
  constexpr std::array<std::string_view, 5> kLocations{"laboratory", "customer", "laboratoryBranch",
                                                       "customerBranch", "other"};
  require(std::ranges::find(kLocations, d.location) != kLocations.end(), "certificate.location");
  const auto dates = wrong_dates(subject, as_left);
  missing.insert(missing.end(), dates.begin(), dates.end());
  return missing;
}

void write_core_data(XmlText& out, const ReportSubject& subject, const MeasurementDays& days) {
  const CertificateDetails& d = subject.details;
  out.open("dcc:coreData");
  out.element("dcc:countryCodeISO3166_1", d.laboratory.country);
  out.element("dcc:usedLangCodeISO639_1", "en");
  out.element("dcc:mandatoryLangCodeISO639_1", "en");
  out.element("dcc:uniqueIdentifier", d.number);
  out.element("dcc:beginPerformanceDate", days.begin);
  out.element("dcc:endPerformanceDate", days.end);
  out.element("dcc:performanceLocation", d.location);
  out.element_if("dcc:issueDate", d.issue_date);
  out.close();
}

void write_item(XmlText& out, const ReportSubject& subject) {
  const CertificateDetails& d = subject.details;
  out.open("dcc:items");
  out.open("dcc:item");
  write_name(out,
             xml_text(subject.document.machine).empty() ? "machine" : subject.document.machine);
  if (!xml_text(d.machine_manufacturer).empty()) {
    out.open("dcc:manufacturer");
    write_name(out, d.machine_manufacturer);
    out.close();
  }
  out.element_if("dcc:model", d.machine_model);
  out.open("dcc:identifications");
  write_identification(out, "manufacturer", d.machine_serial, "serial number");
  write_identification(out, "other", subject.document.machine_hash,
                       "SHA-256 of the machine configuration");
  out.close();
  out.close();
  out.close();
}

void write_people(XmlText& out, const CertificateDetails& d) {
  out.open("dcc:calibrationLaboratory");
  out.element_if("dcc:calibrationLaboratoryCode", d.laboratory_code);
  write_contact(out, "dcc:contact", d.laboratory);
  out.close();
  out.open("dcc:respPersons");
  out.open("dcc:respPerson");
  out.open("dcc:person");
  write_name(out, d.person);
  out.close();
  out.element_if("dcc:role", d.role);
  out.element("dcc:mainSigner", "true");
  out.close();
  out.close();
  write_contact(out, "dcc:customer", d.customer);
}

/// The first statements of the certificate: the restrictions on the use of its models.
Result<std::vector<std::string>> use_of(const ReportSubject& subject, const char* state) {
  return statements_of_use(
      fmt::format("certificate of model {} ({})", model_id(subject.document), state),
      obstacles_to_use(in_use(subject, ModelPurpose::Certificate)), subject.forced);
}

struct UseOfModels {
  std::vector<std::string> as_found, as_left;
};

Result<UseOfModels> use_of_both(const ReportSubject& as_found, const ReportSubject* as_left) {
  auto found = use_of(as_found, "as found");
  ABBE_TRY(found);
  if (as_left == nullptr) return UseOfModels{*std::move(found), {}};
  auto left = use_of(*as_left, "as left");
  ABBE_TRY(left);
  return UseOfModels{*std::move(found), *std::move(left)};
}

void write_statements(XmlText& out, const ReportSubject& subject, const UseOfModels& use,
                      bool has_as_left) {
  const ModelDocument& document = subject.document;
  out.open("dcc:statements");
  write_statement(out, has_as_left ? "Model, as found" : "Model", use.as_found);
  if (has_as_left) write_statement(out, "Model, as left", use.as_left);
  write_statement(out, "Datum", {datum_in_words(document.model)});
  write_statement(out, "Signs", signs_in_words());
  write_statement(out, "Not contained in the uncertainty", not_in_the_uncertainty(document));
  write_statement(out, "Not estimable", not_estimable(document));
  if (!has_as_left)
    write_statement(out, "As left", {"The state after an adjustment was not measured."});
  if (!subject.details.remark.empty()) write_statement(out, "Remark", {subject.details.remark});
  out.close();
}

void write_administrative_data(XmlText& out, const ReportSubject& subject,
                               const ReportSubject* as_left, const UseOfModels& use) {
  out.open("dcc:administrativeData");
  out.open("dcc:dccSoftware");
  write_software(out, ABBE_VERSION);
  out.close();
  write_core_data(out, subject, measurement_days(subject, as_left));
  write_item(out, subject);
  write_people(out, subject.details);
  write_statements(out, subject, use, as_left != nullptr);
  out.close();
}

Result<void> write_result(XmlText& out, const ReportSubject& subject, State state,
                          const CertificateDetails& details) {
  const auto values = certified_values(subject.document);
  ABBE_TRY(values);
  write_measurement_result(out, subject, *values, state, details);
  return {};
}

}  // namespace

Result<std::string> calibration_certificate(const ReportSubject& as_found,
                                            const std::optional<ReportSubject>& as_left) {
  const ReportSubject* const left = as_left ? &*as_left : nullptr;
  if (auto missing = missing_entries(as_found, left); !missing.empty())
    return tl::make_unexpected(
        Error{ErrorCode::BadInput,
              "certificate: entries are missing or invalid; give them with --details FILE",
              std::move(missing)});

  const auto use = use_of_both(as_found, left);
  ABBE_TRY(use);

  XmlText out;
  out.open("dcc:digitalCalibrationCertificate",
           {{"xmlns:dcc", "https://ptb.de/dcc"},
            {"xmlns:si", "https://ptb.de/si"},
            {"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
            {"xsi:schemaLocation", "https://ptb.de/dcc https://ptb.de/dcc/v3.2.1/dcc.xsd"},
            {"schemaVersion", "3.2.1"}});
  write_administrative_data(out, as_found, left, *use);
  out.open("dcc:measurementResults");
  ABBE_TRY(write_result(out, as_found, State::AsFound, as_found.details));
  if (as_left) ABBE_TRY(write_result(out, *as_left, State::AsLeft, as_found.details));
  out.close();
  out.close();
  return out.finish();
}

}  // namespace abbe::daemon
