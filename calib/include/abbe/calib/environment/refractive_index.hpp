#pragma once
/// The phase refractive index of moist air, and what it does to an interferometric distance.
/// Equations: [Ciddor 1996], the modified Edlen equation [Birch & Downs 1993], and a shop-floor
/// formula [Stone & Zimmermann] good to 0.15 ppm. An absolute distance meter needs the group index,
/// which these are not. Pure; any thread.

#include "abbe/calib/error.hpp"

namespace abbe::calib {

enum class IndexEquation { Ciddor, Edlen, ShopFloor };

/// The air with standard uncertainties (k = 1), all taken as independent.
struct Air {
  double temperature_K = 293.15;
  double pressure_Pa = 101325.0;
  double relative_humidity = 0.5;  ///< 0 to 1
  double co2_ppm = 450.0;
  double u_temperature_K = 0.0;
  double u_pressure_Pa = 0.0;
  double u_relative_humidity = 0.0;
  double u_co2_ppm = 0.0;
};

inline constexpr double kHeliumNeon_m = 633e-9;

struct RefractiveIndex {
  double n = 1.0;
  /// [GUM] 5.1.2 eq. (10) of the air's uncertainties and that of the equation itself
  double u_n = 0.0;
};

/// (n - 1) of dry air is multiplied by 1 + this (co2_ppm - 450) [Ciddor 1996], per ppm.
/// [Bonsch & Potulski 1998] give 5.327e-7 from 400 ppm on: less than 3e-10 in n between 0 and
/// 2000 ppm.
inline constexpr double kCo2PerPpm = 5.34e-7;

/// Standard uncertainty that an equation has of its own: 1.5e-8, half of the 3e-8 (k = 2) that is
/// commonly given for both great equations between 0 and 50 C; shop-floor 1.5e-7, as is stated for
/// it.
[[nodiscard]] double u_of_equation(IndexEquation equation) noexcept;

/// BadInput: air outside 0 to 50 C, 500 to 1200 hPa, 0 to 105 %, CO2 0 to 2000 ppm, a wavelength
/// outside 0.35 to 1.2 um, NaN anywhere, a negative uncertainty. Ciddor and Edlen take CO2 into
/// account with kCo2PerPpm. The shop-floor formula ignores the wavelength (633 nm) and holds for
/// 450 ppm of CO2: what the given CO2 differs by is a part of u_n.
[[nodiscard]] Result<RefractiveIndex> refractive_index(const Air& air, double vacuum_wavelength_m,
                                                       IndexEquation equation);

/// Air of a shop floor that no instrument measures: mean and standard uncertainty of rectangular
/// distributions [GUM] 4.3.7 over 15 to 30 C, 950 to 1050 hPa, 10 to 90 %, 400 to 1000 ppm of CO2.
[[nodiscard]] Air shop_floor_air() noexcept;

/// Relative standard uncertainty of distances that are corrected for `assumed` air in place of
/// measured air: hypot(u_n, n - n_assumed) / n with n and u_n of shop_floor_air(). BadInput as
/// refractive_index().
[[nodiscard]] Result<double> u_of_assumed_air(const Air& assumed, double vacuum_wavelength_m,
                                              IndexEquation equation);

/// A distance that an instrument computed with index `n_assumed`, in air of index `n`:
/// d0 * n_assumed / n. Ratio to be multiplied with; its relative uncertainty is u_n / n.
[[nodiscard]] double distance_factor(double n_assumed, double n) noexcept;

/// Saturation vapour pressure over water [Stone & Zimmermann, IAPWS], 0 to 50 C.
[[nodiscard]] double saturation_vapour_pressure_Pa(double temperature_K) noexcept;

}  // namespace abbe::calib
