#pragma once
/// Digital Calibration Certificate: XML after the schema of PTB, DCC 3.2.1 with D-SI 2.1.0
/// (https://ptb.de/dcc/v3.2.1/dcc.xsd). "As found" are the errors of one model; "as left" are the
/// errors of another model, measured after the adjustment. Values and uncertainties are the texts
/// of certified_values.hpp, which the report also prints. The certificate is not signed: signing is
/// left to the laboratory. Pure.

#include <optional>
#include <string>
#include <vector>

#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// Makes the certificate, with the details of `as_found`. BadInput with all entries that are
/// missing or invalid, and with dates that contradict each other or the models; each text names the
/// measurement that it concerns. Refused if a model must not be used (model_use.hpp) and its
/// `forced` is empty; the certificate of a forced model states this first. DataInsufficient as
/// model_report().
[[nodiscard]] Result<std::string> calibration_certificate(
    const ReportSubject& as_found, const std::optional<ReportSubject>& as_left = {});

/// The wrong dates of the details: dates that no calendar has, that are in the future, or that
/// contradict each other, the measurements or the identification of the models. Also contains
/// contradictory_times() of both models. `as_left` may be null.
[[nodiscard]] std::vector<std::string> contradictory_dates(const ReportSubject& as_found,
                                                           const ReportSubject* as_left);

/// The times of the model that contradict each other or are later than the present. Details cannot
/// correct them: a certificate is refused, and a report lists them among its notes.
[[nodiscard]] std::vector<std::string> contradictory_times(const ReportSubject& subject);

/// The wrong dates of [verification]: a date in the future or after the date of issue, and
/// instruments whose calibration was no longer valid at the verification.
[[nodiscard]] std::vector<std::string> wrong_verification_dates(const CertificateDetails& details);

}  // namespace abbe::daemon
