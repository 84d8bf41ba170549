#pragma once
/// Elements of a Digital Calibration Certificate.

#include "abbe/report/model_report.hpp"
#include "xml_text.hpp"

namespace abbe::daemon {

enum class State { AsFound, AsLeft };

/// Writes dcc:name with the text.
void write_name(XmlText& out, std::string_view text);
void write_identification(XmlText& out, std::string_view issuer, std::string_view value,
                          std::string_view name);
void write_contact(XmlText& out, std::string_view element, const Contact& contact);
/// Writes abbe as software, with this release; an empty text means the release of this program.
void write_software(XmlText& out, std::string_view release);
/// Writes dcc:statement with one paragraph for each text.
void write_statement(XmlText& out, std::string_view name, const std::vector<std::string>& texts);
/// Writes dcc:measurementResult: methods, software, equipment, conditions, all values.
void write_measurement_result(XmlText& out, const ReportSubject& subject,
                              const CertifiedValues& values, State state,
                              const CertificateDetails& details);

}  // namespace abbe::daemon
