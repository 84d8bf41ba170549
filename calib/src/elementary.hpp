#pragma once
/// Elementary functions with the same bits on every processor and with every C library: basic
/// operations and square roots of IEEE 754 only, in a written order. The C library's differ between
/// processors with and without fused multiply-add, and between libraries. Error below one unit in
/// the last place, of sine and cosine at most 2^-53 more. Arguments are reduced in parts of
/// constants that multiply without rounding ([Cody 1980]); the series are Taylor's.

#include <cstdint>
#include <random>

namespace abbe::calib {

struct SinCos {
  double sin = 0.0;
  double cos = 1.0;
};

/// Of angles up to 1e6 rad; NaN beyond and for NaN.
[[nodiscard]] SinCos sin_cos(double angle_rad) noexcept;

/// e^x; 0 below -708, infinite above 709.
[[nodiscard]] double exponential(double x) noexcept;

/// Of positive normal numbers; NaN for others.
[[nodiscard]] double natural_logarithm(double x) noexcept;

/// x^n by repeated multiplication.
[[nodiscard]] double power(double x, int n) noexcept;

/// Independent standard normal deviates ([Box 1958]); the same sequence for a seed everywhere,
/// where that of std::normal_distribution is the library's choice.
class NormalDeviates {
 public:
  explicit NormalDeviates(std::uint64_t seed) : random_(seed) {}
  [[nodiscard]] double next();

 private:
  /// In (0, 1).
  double uniform() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }

  std::mt19937_64 random_;  // its sequence is in the C++ standard
  double second_ = 0.0;
  bool has_second_ = false;
};

}  // namespace abbe::calib
