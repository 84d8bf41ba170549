#pragma once
/// Elementary functions with bit-identical results on every processor and with every C library.
/// They use only basic operations and square roots of IEEE 754, in a fixed order. The results of
/// the C library's functions differ between libraries and between processors with and without fused
/// multiply-add. Error: less than one unit in the last place; for sine and cosine up to 2^-53 more.
/// Arguments are reduced with constants split into parts whose products are exact ([Cody 1980]);
/// the series are Taylor series.

#include <cstdint>
#include <random>

namespace abbe::calib {

struct SinCos {
  double sin = 0.0;
  double cos = 1.0;
};

/// Sine and cosine for |angle_rad| <= 1e6; NaN for larger angles and for NaN.
[[nodiscard]] SinCos sin_cos(double angle_rad) noexcept;

/// The exponential function e^x; 0 below -708, infinite above 709.
[[nodiscard]] double exponential(double x) noexcept;

/// Natural logarithm of positive normal numbers; NaN for all others.
[[nodiscard]] double natural_logarithm(double x) noexcept;

/// The power x^n by repeated multiplication.
[[nodiscard]] double power(double x, int n) noexcept;

/// Independent standard normal deviates ([Box 1958]). A seed gives the same sequence on every
/// platform; std::normal_distribution does not guarantee that.
class NormalDeviates {
 public:
  explicit NormalDeviates(std::uint64_t seed) : random_(seed) {}
  [[nodiscard]] double next();

 private:
  /// Random number, uniformly distributed in (0, 1).
  double uniform() { return (static_cast<double>(random_() >> 11) + 0.5) * 0x1p-53; }

  std::mt19937_64 random_;  // a standard generator: its sequence is defined by the C++ standard
  double second_ = 0.0;
  bool has_second_ = false;
};

}  // namespace abbe::calib
