#pragma once
/// The phase refractive index of moist air and its effect on an interferometric distance.
/// Equations: [Ciddor 1996], the modified Edlen equation [Birch & Downs 1993], and a shop-floor
/// formula [Stone & Zimmermann] with an uncertainty of 0.15 ppm. Not for absolute distance meters:
/// these need the group index. Pure; any thread.

#include "abbe/calib/base/error.hpp"

namespace abbe::calib {

enum class IndexEquation { Ciddor, Edlen, ShopFloor };

/// State of the air with standard uncertainties (k = 1), assumed to be independent.
struct Air {
  double temperature_K = 293.15;
  double pressure_Pa = 101325.0;
  double relative_humidity = 0.5;  ///< from 0 (dry) to 1 (saturated)
  double co2_ppm = 450.0;
  double u_temperature_K = 0.0;
  double u_pressure_Pa = 0.0;
  double u_relative_humidity = 0.0;
  double u_co2_ppm = 0.0;
};

inline constexpr double kHeliumNeon_m = 633e-9;

struct RefractiveIndex {
  double n = 1.0;
  /// combined standard uncertainty [GUM] 5.1.2 eq. (10): uncertainties of the air and of the
  /// equation
  double u_n = 0.0;
};

/// CO2 coefficient per ppm [Ciddor 1996]: (n - 1) of dry air is multiplied by
///     1 + kCo2PerPpm (co2_ppm - 450).
/// [Bonsch & Potulski 1998] give 5.327e-7, relative to 400 ppm; the difference in n is less than
/// 3e-10 between 0 and 2000 ppm.
inline constexpr double kCo2PerPpm = 5.34e-7;

/// Standard uncertainty of the equation itself. Ciddor and Edlen: 1.5e-8, half of the 3e-8 (k = 2)
/// commonly stated for both between 0 and 50 C. Shop-floor formula: 1.5e-7, as stated with it.
[[nodiscard]] double u_of_equation(IndexEquation equation) noexcept;

/// Computes n with its uncertainty. Ciddor and Edlen take CO2 into account with kCo2PerPpm. The
/// shop-floor formula is for 633 nm and 450 ppm of CO2 and ignores the given wavelength; the effect
/// of a different CO2 content is added to u_n. BadInput: air outside 0 to 50 C, 500 to 1200 hPa, 0
/// to 105 % relative humidity or 0 to 2000 ppm of CO2, a wavelength outside 0.35 to 1.2 um, NaN
/// anywhere, a negative uncertainty.
[[nodiscard]] Result<RefractiveIndex> refractive_index(const Air& air, double vacuum_wavelength_m,
                                                       IndexEquation equation);

/// Assumed air of a shop floor without measurement: means and standard uncertainties of rectangular
/// distributions [GUM] 4.3.7 over 15 to 30 C, 950 to 1050 hPa, 10 to 90 % relative humidity and 400
/// to 1000 ppm of CO2.
[[nodiscard]] Air shop_floor_air() noexcept;

/// Relative standard uncertainty of distances that are corrected with the index n_assumed of the
/// `assumed` air instead of the index of measured air:
///     hypot(u_n, n - n_assumed) / n,   n and u_n of shop_floor_air().
/// BadInput as refractive_index().
[[nodiscard]] Result<double> u_of_assumed_air(const Air& assumed, double vacuum_wavelength_m,
                                              IndexEquation equation);

/// Correction factor for a distance d0 that an instrument computed with index `n_assumed` in air of
/// index `n`:
///     d = d0 * distance_factor(n_assumed, n) = d0 * n_assumed / n
/// The relative standard uncertainty of the factor is u_n / n.
[[nodiscard]] double distance_factor(double n_assumed, double n) noexcept;

/// Saturation vapour pressure over water [Stone & Zimmermann, IAPWS], 0 to 50 C.
[[nodiscard]] double saturation_vapour_pressure_Pa(double temperature_K) noexcept;

}  // namespace abbe::calib
