#pragma once
/// Constants common to the writer and the reader of model.json.

#include <string_view>

#include "abbe/calib/error_parameters.hpp"

namespace abbe::daemon {

inline constexpr std::string_view kModelSchema = "abbe/model/1";
inline constexpr std::string_view kVersion = ABBE_VERSION;
inline constexpr std::string_view kLegendre = "legendre";  ///< basis of a polynomial model

// Shift of the decimal point between SI and the file.
inline constexpr int kMm = 3;
inline constexpr int kMicroUnit = 6;          // um, urad
inline constexpr int kMicroUnitSquared = 12;  // their products

[[nodiscard]] inline std::string_view unit_of(const calib::Parameter& p) {
  return p.is_angle() ? "urad" : "um";
}

}  // namespace abbe::daemon
