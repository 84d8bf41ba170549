#pragma once
/// Constants common to the writer and the reader of model.json.

#include <string_view>

#include "abbe/calib/geometry/error_parameters.hpp"
#include "abbe/calib/model/volumetric_model.hpp"

namespace abbe::daemon {

inline constexpr std::string_view kModelSchema = "abbe/model/1";
inline constexpr std::string_view kVersion = ABBE_VERSION;
/// The abscissa of RunFigures::Series: time or number.
inline constexpr std::string_view kOverTime = "time_s", kOverNumber = "number";
inline constexpr std::string_view kLegendre = "legendre";  ///< basis of a polynomial model

// Shift of the decimal point between SI and the unit in the file.
inline constexpr int kMm = 3;
inline constexpr int kMicroUnit = 6;          // um, urad
inline constexpr int kMicroUnitSquared = 12;  // their products

/// `basis.kind` of model.json: for tables the name of their interpolation, else kLegendre.
[[nodiscard]] inline std::string_view basis_kind(const calib::VolumetricModel& model) {
  const auto interpolation = model.interpolation();
  return interpolation ? calib::name(*interpolation) : kLegendre;
}

/// The nodes that the file contains: for tables their nodes, for polynomials the grid at which they
/// are checked.
[[nodiscard]] inline const calib::MachineNodes& stored_nodes(const calib::VolumetricModel& model) {
  return model.tables() == nullptr ? model.nodes() : model.tables()->layout().nodes();
}

[[nodiscard]] inline std::string_view unit_of(const calib::Parameter& p) {
  return p.is_angle() ? "urad" : "um";
}
/// The unit of a difference between the directions of travel.
[[nodiscard]] inline std::string_view unit_of(const calib::ErrorMotion& m) {
  return calib::is_rotation(m.motion) ? "urad" : "um";
}

}  // namespace abbe::daemon
