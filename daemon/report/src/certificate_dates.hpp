#pragma once
/// Days in a certificate: of its measurements and of its issue. A day is a text as in ISO 8601,
/// "2026-11-26"; texts are compared to order days. Days from the details are local days, days from
/// the models are UTC.

#include <string>
#include <vector>

#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// The day of a time in UTC: "2024-05-17".
[[nodiscard]] std::string day_of(protocol::UtcTime time);

/// First and last day of all measurements of a certificate, from the details, or from the models if
/// the details do not state them. Empty: not known.
struct MeasurementDays {
  std::string begin, end;
};

/// `as_left` may be null.
[[nodiscard]] MeasurementDays measurement_days(const ReportSubject& as_found,
                                               const ReportSubject* as_left);

/// The faults of all days: missing days, contradictory_dates(), and equipment whose calibration was
/// no longer valid.
[[nodiscard]] std::vector<std::string> wrong_dates(const ReportSubject& as_found,
                                                   const ReportSubject* as_left);

}  // namespace abbe::daemon
