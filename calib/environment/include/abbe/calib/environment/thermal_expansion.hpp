#pragma once
/// Thermal expansion relative to the reference temperature of 20 C [ISO 1], and the correction of
/// scales. Above 20 C the graduation of a scale is too wide: the true travel of the axis is longer
/// than its reading. Pure; any thread.

namespace abbe::calib {

inline constexpr double kReferenceTemperature_K = 293.15;  ///< 20 C, the reference temperature of
                                                           ///< [ISO 1]

/// Coefficient of linear thermal expansion with its standard uncertainty.
struct Expansivity {
  double alpha_per_K = 0.0;
  double u_alpha_per_K = 0.0;
};

/// Linear thermal expansion of a scale or part. Standard uncertainties (k = 1), assumed to be
/// independent.
struct Expansion {
  /// typical values: 11.5e-6 for steel, 8e-6 for glass scales; use the value of the data sheet
  double alpha_per_K = 0.0;
  double u_alpha_per_K = 0.0;  ///< about 1e-6 for a value from a table
  double temperature_K = kReferenceTemperature_K;
  double u_temperature_K = 0.0;
};

/// 1 + alpha (T - 20 C): ratio of the length at T to the length at 20 C.
[[nodiscard]] double expansion_factor(const Expansion& e) noexcept;
/// Standard uncertainty of expansion_factor() [GUM] 5.1.2 eq. (10):
///     u^2 = ((T - 20 C) u_alpha)^2 + (alpha u_T)^2
[[nodiscard]] double u_expansion_factor(const Expansion& e) noexcept;

struct UncertainLength {
  double value_m = 0.0;
  double u_m = 0.0;  ///< standard uncertainty of the thermal correction alone
};

/// True position of an axis at the reading `reading_m`. `fixed_m` is the reading at the point where
/// the scale is fixed to the machine; the scale expands from this point.
[[nodiscard]] UncertainLength true_position(double reading_m, double fixed_m,
                                            const Expansion& scale) noexcept;

}  // namespace abbe::calib
