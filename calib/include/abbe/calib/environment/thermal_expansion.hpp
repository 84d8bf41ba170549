#pragma once
/// Lengths at the reference temperature of 20 C [ISO 1]. A scale that is warm has its marks too far
/// apart: the machine has moved farther than it reads. A part that is warm is too long. The two are
/// corrected separately, each with its own temperature and coefficient. Pure; any thread.

namespace abbe::calib {

inline constexpr double kReferenceTemperature_K = 293.15;  ///< [ISO 1]

/// What expands: linear, with standard uncertainties (k = 1), taken as independent.
struct Expansion {
  /// 11.5e-6 for steel, 8e-6 for glass scales: take it from the data sheet
  double alpha_per_K = 0.0;
  double u_alpha_per_K = 0.0;  ///< about 1e-6 if it is from a table
  double temperature_K = kReferenceTemperature_K;
  double u_temperature_K = 0.0;
};

/// 1 + alpha (T - 20 C): what is 1 m long at 20 C is that many metres long at T.
[[nodiscard]] double expansion_factor(const Expansion& e) noexcept;
/// Relative standard uncertainty of expansion_factor(): ((T - 20) u_alpha)^2 + (alpha u_T)^2 [GUM] 5.1.2
/// eq. (10).
[[nodiscard]] double u_expansion_factor(const Expansion& e) noexcept;

struct UncertainLength {
  double value_m = 0.0;
  double u_m = 0.0;  ///< of the thermal correction alone
};

/// L20 = L_T / expansion factor: a part of length L_T at its temperature, at 20 C.
[[nodiscard]] UncertainLength length_at_reference(double length_m, const Expansion& part) noexcept;

/// How far an axis really is from where its scale is fixed (`fixed_m`, a reading), given what it
/// reads.
[[nodiscard]] UncertainLength true_position(double reading_m, double fixed_m,
                                            const Expansion& scale) noexcept;

/// A part measured by reading a scale, both warm: L expansion_factor(scale) / expansion_factor(part).
[[nodiscard]] UncertainLength length_at_reference(double reading_m, const Expansion& scale,
                                                  const Expansion& part) noexcept;

}  // namespace abbe::calib
