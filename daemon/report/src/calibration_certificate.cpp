#include "abbe/report/calibration_certificate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "abbe/base/utc_text.hpp"
#include "abbe/report/model_words.hpp"
#include "certificate_parts.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

/// The date of an instant, "2024-05-17".
std::string date_of(protocol::UtcTime time) {
  constexpr std::size_t kDate = 10;
  return to_text(time).substr(0, kDate);
}

/// Days of the measurement: those of the details, else that of the model.
struct MeasurementDays {
  std::string begin, end;
  explicit MeasurementDays(const ReportSubject& subject)
      : begin(subject.details.begin_date), end(subject.details.end_date) {
    const std::string day = date_of(subject.document.created);
    if (begin.empty()) begin = end.empty() ? day : std::min(day, end);
    if (end.empty()) end = std::max(day, begin);
  }
};

/// Dates that contradict each other. Dates as in ISO 8601 are ordered as texts.
void add_wrong_dates(const ReportSubject& subject, std::vector<std::string>& wrong) {
  const CertificateDetails& d = subject.details;
  for (const std::string& date : {d.begin_date, d.end_date, d.issue_date})
    if (!date.empty() && !is_date(date)) {
      wrong.emplace_back("certificate: dates such as \"2026-11-26\"");
      return;
    }
  const MeasurementDays days(subject);
  if (days.end < days.begin)
    wrong.push_back(
        fmt::format("certificate.end_date: {} is before begin_date, {}", days.end, days.begin));
  if (!d.issue_date.empty() && d.issue_date < days.end)
    wrong.push_back(
        fmt::format("certificate.issue_date: {} is before the end of the measurement, {}",
                    d.issue_date, days.end));
  for (const EquipmentDetails& e : d.equipment)
    if (!e.valid_until.empty() && e.valid_until < days.end)
      wrong.push_back(
          fmt::format("equipment \"{}\": its calibration was valid until {}, the "
                      "measurement ended {}",
                      e.name, e.valid_until, days.end));
}

/// Entries without which a certificate is not valid.
std::vector<std::string> missing_entries(const ReportSubject& subject) {
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
  add_wrong_dates(subject, missing);
  return missing;
}

void write_core_data(XmlText& out, const ReportSubject& subject) {
  const CertificateDetails& d = subject.details;
  const MeasurementDays days(subject);
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

void write_statements(XmlText& out, const ReportSubject& subject, bool has_as_left) {
  const ModelDocument& document = subject.document;
  out.open("dcc:statements");
  write_statement(out, "Gauge", {gauge_in_words(document.model)});
  write_statement(out, "Signs", signs_in_words());
  write_statement(out, "Not contained in the uncertainty", not_in_the_uncertainty(document));
  write_statement(out, "Not estimable", not_estimable(document));
  if (!has_as_left)
    write_statement(out, "As left", {"The state after an adjustment was not measured."});
  if (!subject.details.remark.empty()) write_statement(out, "Remark", {subject.details.remark});
  out.close();
}

void write_administrative_data(XmlText& out, const ReportSubject& subject, bool has_as_left) {
  out.open("dcc:administrativeData");
  out.open("dcc:dccSoftware");
  write_software(out);
  out.close();
  write_core_data(out, subject);
  write_item(out, subject);
  write_people(out, subject.details);
  write_statements(out, subject, has_as_left);
  out.close();
}

Result<void> write_result(XmlText& out, const ReportSubject& subject, State state,
                          const CertificateDetails& details) {
  const auto values = certified_values(subject.document);
  if (!values) return tl::make_unexpected(values.error());
  write_measurement_result(out, subject, *values, state, details);
  return {};
}

}  // namespace

Result<std::string> calibration_certificate(const ReportSubject& as_found,
                                            const std::optional<ReportSubject>& as_left) {
  if (auto missing = missing_entries(as_found); !missing.empty())
    return tl::make_unexpected(
        Error{ErrorCode::BadInput,
              "certificate: entries are missing or invalid; give them with --details FILE",
              std::move(missing)});

  XmlText out;
  out.open("dcc:digitalCalibrationCertificate",
           {{"xmlns:dcc", "https://ptb.de/dcc"},
            {"xmlns:si", "https://ptb.de/si"},
            {"xmlns:xsi", "http://www.w3.org/2001/XMLSchema-instance"},
            {"xsi:schemaLocation", "https://ptb.de/dcc https://ptb.de/dcc/v3.2.1/dcc.xsd"},
            {"schemaVersion", "3.2.1"}});
  write_administrative_data(out, as_found, as_left.has_value());
  out.open("dcc:measurementResults");
  if (auto done = write_result(out, as_found, State::AsFound, as_found.details); !done)
    return tl::make_unexpected(done.error());
  if (as_left)
    if (auto done = write_result(out, *as_left, State::AsLeft, as_found.details); !done)
      return tl::make_unexpected(done.error());
  out.close();
  out.close();
  return out.finish();
}

}  // namespace abbe::daemon
