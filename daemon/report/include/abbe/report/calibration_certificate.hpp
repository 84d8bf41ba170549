#pragma once
/// Digital Calibration Certificate: XML after the schema of PTB, DCC 3.2.1 with D-SI 2.1.0
/// (https://ptb.de/dcc/v3.2.1/dcc.xsd). As found: the errors of one model. As left: those of
/// another model, measured after the adjustment. Values and uncertainties are the texts of
/// certified_values.hpp, which the report prints, too. The certificate is not signed: signing is
/// left to the laboratory. Pure.

#include <optional>
#include <string>
#include <vector>

#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// The details are those of `as_found`. BadInput with all entries that are missing or invalid, also
/// dates that contradict each other or the models; entries say which measurement it is about.
/// Refused if a model must not be used (model_use.hpp) and its `forced` is empty; the certificate
/// of a forced one states this first. DataInsufficient as model_report().
[[nodiscard]] Result<std::string> calibration_certificate(
    const ReportSubject& as_found, const std::optional<ReportSubject>& as_left = {});

/// Dates of the details that no calendar has, that contradict each other, the measurements or the
/// identification of the models, or that are in the future; and contradictory_times() of both.
/// `as_left` may be null.
[[nodiscard]] std::vector<std::string> contradictory_dates(const ReportSubject& as_found,
                                                           const ReportSubject* as_left);

/// Times of the model alone that contradict each other or the present. No details can correct them:
/// a certificate is refused, a report has them among its notes.
[[nodiscard]] std::vector<std::string> contradictory_times(const ReportSubject& subject);

/// Of [verification]: a date in the future or after the date of issue, and instruments whose
/// calibration was not valid any more.
[[nodiscard]] std::vector<std::string> wrong_verification_dates(const CertificateDetails& details);

}  // namespace abbe::daemon
