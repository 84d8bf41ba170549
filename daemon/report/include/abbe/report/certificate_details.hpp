#pragma once
/// The information in a report and a certificate that is not in the model: people and firms, serial
/// numbers, conditions. Every entry may be absent (empty), but a certificate requires some of them.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/utc_text.hpp"

namespace abbe::daemon {

struct Contact {
  std::string name, street, city, post_code, email;
  std::string country{};  ///< ISO 3166-1, two capital letters
};

/// The measurement in which an instrument was used: the measurement of MODEL (as found), that of
/// `--as-left`, both, or the independent measurement of a verification.
enum class EquipmentUse { AsFound, AsLeft, Both, Verification };

struct EquipmentDetails {
  std::string name, manufacturer, model, serial, certificate;
  std::string valid_until{};  ///< last day of its calibration, "2027-03-31"
  EquipmentUse use = EquipmentUse::AsFound;
};
/// True if the instrument was used in the measurement `use`.
[[nodiscard]] bool is_used(const EquipmentDetails& equipment, EquipmentUse use);

/// The largest permitted absolute value of one value of the report.
struct ToleranceDetails {
  std::string value;         ///< CertifiedValue::key: "X.M", "EC0Y", "U.max"
  double limit_um_urad = 0;  ///< um, or urad for an angle; positive
  bool is_angle = false;     ///< the limit was given in urad
};

/// The independent measurement of a verification. Its file of points does not contain these
/// entries.
struct VerificationDetails {
  std::string date{};           ///< local date as in ISO 8601
  std::string operator_name{};  ///< person who made the measurement
  std::optional<double> temperature_C{};
  /// Standard uncertainty of each coordinate of a measured point, k = 1. Required if a limit is
  /// given.
  std::optional<double> u_um{};
  /// Largest permitted residuals with the model. Absent: no statement of conformity.
  std::optional<double> limit_rms_um{}, limit_max_um{};
};

struct CertificateDetails {
  /// Dates as in ISO 8601, "2026-11-26". location: one of laboratory, customer, laboratoryBranch,
  /// customerBranch, other.
  std::string number, begin_date, end_date, issue_date, location, remark;
  Contact laboratory, customer;
  std::string laboratory_code;  ///< number of the laboratory's accreditation
  std::string person, role;     ///< the person who is responsible and signs
  std::string machine_manufacturer, machine_model, machine_serial;
  /// Conditions of the measurement; with two models those of the first one (as found). If they are
  /// absent, the conditions that the run recorded are stated.
  std::optional<double> temperature_C, u_temperature_K, humidity_percent, feed_mm_per_min;
  std::vector<EquipmentDetails> equipment;
  std::vector<ToleranceDetails> tolerances{};  ///< empty: no statement of conformity
  VerificationDetails verification{};
  /// Time at which the certificate is made: later dates of issue and identification are refused.
  /// nullopt: not known.
  std::optional<protocol::UtcTime> now{};
};

/// True for an existing day as in ISO 8601, "2026-11-26", in the years 1 to 9999.
[[nodiscard]] bool is_date(std::string_view text);
/// True for two capital letters.
[[nodiscard]] bool is_country_code(std::string_view text);

}  // namespace abbe::daemon
