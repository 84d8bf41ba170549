#pragma once
/// Days of a certificate: of its measurements and of its issue. Days are texts as in ISO 8601,
/// "2026-11-26", and are ordered as texts. Those of the details are local days, those of the models
/// UTC.

#include <string>
#include <vector>

#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// "2024-05-17", UTC
[[nodiscard]] std::string day_of(protocol::UtcTime time);

/// First and last day of all measurements of a certificate: those of the details, else those of the
/// models. Empty: not known.
struct MeasurementDays {
  std::string begin, end;
};

/// `as_left` may be null.
[[nodiscard]] MeasurementDays measurement_days(const ReportSubject& as_found,
                                               const ReportSubject* as_left);

/// Days that are missing, and contradictory_dates(), and equipment whose calibration was not valid
/// any more.
[[nodiscard]] std::vector<std::string> wrong_dates(const ReportSubject& as_found,
                                                   const ReportSubject* as_left);

}  // namespace abbe::daemon
