#pragma once
/// Converts the configuration to the input types of calib. Only sources that use calib include this
/// header. Pure.

#include <optional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/calib/otf/run/run.hpp"
#include "abbe/config/config.hpp"

namespace abbe::daemon {

[[nodiscard]] calib::Interpolation calib_of(TableInterpolation) noexcept;
[[nodiscard]] TableInterpolation config_of(calib::Interpolation) noexcept;
[[nodiscard]] calib::IndexEquation calib_of(AirEquation) noexcept;
[[nodiscard]] calib::otf::Mode calib_of(OtfMode) noexcept;
[[nodiscard]] OtfMode config_of(calib::otf::Mode) noexcept;
[[nodiscard]] calib::otf::Estimator calib_of(OtfEstimator) noexcept;
[[nodiscard]] OtfEstimator config_of(calib::otf::Estimator) noexcept;
[[nodiscard]] calib::TravelDependence calib_of(OtfBacklash) noexcept;
[[nodiscard]] OtfBacklash config_of(calib::TravelDependence) noexcept;

/// The reference nests of [[tracker.nest]].
[[nodiscard]] calib::otf::NestOptions nest_options(const OtfConfig&);
[[nodiscard]] std::optional<calib::otf::SmoothnessOptions> smoothness_options(const OtfConfig&);

/// BadInput if the chain or the nodes do not describe a machine with three linear axes.
[[nodiscard]] Result<calib::otf::Machine> otf_machine(const MachineConfig& machine);

/// BadInput if [target] offset_mm (tool reference point to reflector) is missing. Every calibration
/// needs this offset; without this check the default zeros would be used.
[[nodiscard]] Result<void> require_target(const MachineConfig& machine);

}  // namespace abbe::daemon
