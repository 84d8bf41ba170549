#include "certificate_dates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>

#include "abbe/report/calibration_certificate.hpp"
#include "report_sections.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;

// Local time is between UTC - 12 h and UTC + 14 h.
constexpr auto kMostBehindUtc = 12h, kMostAheadOfUtc = 14h;

std::optional<std::string> first_day(const ReportSubject& subject) {
  const auto measured = measured_of(subject.document);
  return measured ? std::optional(day_of((*measured)[0])) : std::nullopt;
}

std::optional<std::string> last_day(const ReportSubject& subject) {
  const auto measured = measured_of(subject.document);
  return measured ? std::optional(day_of((*measured)[1])) : std::nullopt;
}

bool has_only_dates(const CertificateDetails& d) {
  return std::ranges::all_of(std::array{d.begin_date, d.end_date, d.issue_date},
                             [](const std::string& date) { return date.empty() || is_date(date); });
}

/// Adds the dates of the details that cannot agree with the measurement of the model in any time
/// zone.
void compare_with_model(const CertificateDetails& d, const ReportSubject& subject,
                        std::string_view state, std::vector<std::string>& wrong) {
  const auto measured = measured_of(subject.document);
  if (!measured) return;
  const auto [first, last] = *measured;
  if (!d.begin_date.empty() && day_of(first + kMostAheadOfUtc) < d.begin_date)
    wrong.push_back(fmt::format("certificate.begin_date: {} is after {} began, {} (UTC)",
                                d.begin_date, state, day_of(first)));
  if (!d.end_date.empty() && d.end_date < day_of(last - kMostBehindUtc))
    wrong.push_back(fmt::format("certificate.end_date: {} is before {} ended, {} (UTC)", d.end_date,
                                state, day_of(last)));
}

/// Adds a measurement that ends after the model was identified.
void compare_with_identification(const CertificateDetails& d, const ReportSubject& subject,
                                 bool is_last, std::vector<std::string>& wrong) {
  const protocol::UtcTime created = subject.document.created;
  const std::string latest = day_of(created + kMostAheadOfUtc);
  const auto require = [&](const std::string& day, const char* key) {
    if (day > latest)
      wrong.push_back(fmt::format("certificate.{}: {} is after the model was identified, {} (UTC)",
                                  key, day, day_of(created)));
  };
  require(d.begin_date, "begin_date");
  if (is_last) require(d.end_date, "end_date");
}

/// Adds the times of the model that contradict each other or are later than the present time `now`.
void compare_clocks(const ModelDocument& document, const std::optional<protocol::UtcTime>& now,
                    std::vector<std::string>& wrong) {
  const protocol::UtcTime created = document.created;
  const auto measured = measured_of(document);
  if (measured && (*measured)[1] > created + kMostAheadOfUtc)
    wrong.push_back(fmt::format(
        "model {}: measured until {}, but identified {} (UTC): one of the clocks was wrong; "
        "identify it again",
        model_id(document), to_seconds((*measured)[1]), to_seconds(created)));
  if (now && created > *now + kMostAheadOfUtc)
    wrong.push_back(
        fmt::format("model {}: identified {}, which is in the future (now {} UTC): the "
                    "clock of this or that computer is wrong",
                    model_id(document), to_seconds(created), to_seconds(*now)));
}

/// Adds the dates that are later than the present day.
void compare_with_today(const CertificateDetails& d, std::vector<std::string>& wrong) {
  if (d.now && d.issue_date > day_of(*d.now + kMostAheadOfUtc))
    wrong.push_back(fmt::format("certificate.issue_date: {} is in the future, today is {} (UTC)",
                                d.issue_date, day_of(*d.now)));
}

void compare_measurements(const ReportSubject& as_found, const ReportSubject& as_left,
                          std::vector<std::string>& wrong) {
  const auto found = measured_of(as_found.document), left = measured_of(as_left.document);
  if (found && left && (*left)[0] < (*found)[1])
    wrong.push_back(fmt::format("--as-left: {}, before the end of as found, {}",
                                when_in_words(as_left.document), to_seconds((*found)[1])));
}

/// Adds equipment whose calibration was no longer valid. `state`: text for the message, "the
/// measurement" or "as left"; `ended`: last day of the measurement, empty: not known.
void compare_equipment(const std::vector<EquipmentDetails>& equipment, EquipmentUse use,
                       std::string_view state, const std::string& ended,
                       std::vector<std::string>& wrong) {
  for (const EquipmentDetails& e : equipment)
    if (is_used(e, use) && !e.valid_until.empty() && e.valid_until < ended)
      wrong.push_back(
          fmt::format("equipment \"{}\": its calibration was valid until {}, {} ended "
                      "{}",
                      e.name, e.valid_until, state, ended));
}

}  // namespace

std::string day_of(protocol::UtcTime time) {
  constexpr std::size_t kDate = 10;
  return to_seconds(time).substr(0, kDate);
}

MeasurementDays measurement_days(const ReportSubject& as_found, const ReportSubject* as_left) {
  const CertificateDetails& d = as_found.details;
  MeasurementDays days{d.begin_date, d.end_date};
  const auto first = first_day(as_found), last = last_day(as_left != nullptr ? *as_left : as_found);
  if (days.begin.empty() && first)
    days.begin = days.end.empty() ? *first : std::min(*first, days.end);
  if (days.end.empty() && last) days.end = std::max(*last, days.begin);
  return days;
}

std::vector<std::string> contradictory_dates(const ReportSubject& as_found,
                                             const ReportSubject* as_left) {
  const CertificateDetails& d = as_found.details;
  if (!has_only_dates(d)) return {"certificate: dates such as \"2026-11-26\""};

  std::vector<std::string> wrong;
  const MeasurementDays days = measurement_days(as_found, as_left);
  if (!days.end.empty() && days.end < days.begin)
    wrong.push_back(
        fmt::format("certificate.end_date: {} is before begin_date, {}", days.end, days.begin));
  if (!d.issue_date.empty() && d.issue_date < days.end)
    wrong.push_back(
        fmt::format("certificate.issue_date: {} is before the end of the measurement, {}",
                    d.issue_date, days.end));

  compare_with_model(d, as_found, as_left != nullptr ? "as found" : "the measurement", wrong);
  compare_with_identification(d, as_found, as_left == nullptr, wrong);
  compare_with_today(d, wrong);
  compare_clocks(as_found.document, d.now, wrong);
  if (as_left == nullptr) return wrong;
  compare_with_model(d, *as_left, "as left", wrong);
  compare_with_identification(d, *as_left, true, wrong);
  compare_clocks(as_left->document, d.now, wrong);
  compare_measurements(as_found, *as_left, wrong);
  return wrong;
}

std::vector<std::string> contradictory_times(const ReportSubject& subject) {
  std::vector<std::string> wrong;
  compare_clocks(subject.document, subject.details.now, wrong);
  return wrong;
}

std::vector<std::string> wrong_verification_dates(const CertificateDetails& details) {
  std::vector<std::string> wrong;
  const std::string& day = details.verification.date;
  if (details.now && day > day_of(*details.now + kMostAheadOfUtc))
    wrong.push_back(fmt::format("verification.date: {} is in the future, today is {} (UTC)", day,
                                day_of(*details.now)));
  if (!details.issue_date.empty() && details.issue_date < day)
    wrong.push_back(fmt::format("certificate.issue_date: {} is before the verification, {}",
                                details.issue_date, day));
  compare_with_today(details, wrong);
  const std::string ended = day.empty() && details.now ? day_of(*details.now) : day;
  compare_equipment(details.equipment, EquipmentUse::Verification, "the verification", ended,
                    wrong);
  return wrong;
}

std::vector<std::string> wrong_dates(const ReportSubject& as_found, const ReportSubject* as_left) {
  const CertificateDetails& d = as_found.details;
  std::vector<std::string> wrong = contradictory_dates(as_found, as_left);
  if (!has_only_dates(d)) return wrong;
  const MeasurementDays days = measurement_days(as_found, as_left);
  constexpr const char* kNotKnown =
      "certificate.{}: the model does not have the time of its measurement";
  if (days.begin.empty()) wrong.push_back(fmt::format(kNotKnown, "begin_date"));
  if (days.end.empty()) wrong.push_back(fmt::format(kNotKnown, "end_date"));

  if (as_left == nullptr) {
    compare_equipment(d.equipment, EquipmentUse::AsFound, "the measurement", days.end, wrong);
    return wrong;
  }
  compare_equipment(d.equipment, EquipmentUse::AsFound, "as found",
                    last_day(as_found).value_or(days.begin), wrong);
  compare_equipment(d.equipment, EquipmentUse::AsLeft, "as left", days.end, wrong);
  return wrong;
}

}  // namespace abbe::daemon
