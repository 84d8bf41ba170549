#include "abbe/config/unmeasured_air.hpp"

#include <fmt/format.h>

#include "abbe/base/units.hpp"
#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/config/capabilities.hpp"

namespace abbe::daemon {

double u_of_unmeasured_air() noexcept {
  // The result always has a value: assumed_air() is within the range of the equation.
  constexpr AssumedAir air;
  static const double u =
      *calib::u_of_assumed_air({.temperature_K = air.temperature_K,
                                .pressure_Pa = air.pressure_Pa,
                                .relative_humidity = air.relative_humidity},
                               calib::kHeliumNeon_m, calib::IndexEquation::Ciddor);
  return u;
}

std::optional<std::string> unmeasured_air_text(const Config& config, double u_scale) {
  const auto tracker = tracker_source(config);
  const bool measured = !tracker || tracker->air == TrackerSource::Air::Measured;
  if (measured || config.air.assumed_index) return std::nullopt;
  const AssumedAir air = assumed_air();
  const std::string corrected_for =
      tracker->air == TrackerSource::Air::Assumed
          ? fmt::format("air not measured: the ranges are corrected for {:g} C, {:g} hPa, {:g} %",
                        air.temperature_K - kZeroCelsius_K, air.pressure_Pa * 1e-2,
                        air.relative_humidity * 1e2)
          : std::string{
                "air measured, but the ranges are corrected with the index that was last set in "
                "the controller"};

  return fmt::format(
      "{} ({}); the standard uncertainty of their common scale is set to "
      "{:.3g} um/m, for a shop floor {:.3g} um/m is realistic; set weather = \"compute\" to "
      "correct for measured air",
      corrected_for, tracker->air_setting, u_scale * 1e6, u_of_unmeasured_air() * 1e6);
}

}  // namespace abbe::daemon
