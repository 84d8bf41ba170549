#include "abbe/calib/verify/expanded_uncertainty.hpp"

#include <cmath>

#include "abbe/calib/internal/statistics/chi2_tail.hpp"

namespace abbe::calib::verify {
namespace {

/// The x that chi-square with 3 degrees of freedom exceeds with probability `tail`, by bisection.
double chi2_exceeded_with(double tail) {
  constexpr std::size_t kCoordinates = 3;
  constexpr int kHalvings = 60;
  const double log_tail = std::log(tail);
  double low = 0.0, high = 1.0;
  while (log_chi2_tail(high, kCoordinates) > log_tail) high *= 2.0;

  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (log_chi2_tail(middle, kCoordinates) > log_tail ? low : high) = middle;
  }
  return high;
}

}  // namespace

ResidualU expanded_uncertainty(double u_m, std::size_t places) {
  constexpr double kTail = 0.05;
  return {.rms_m = u_m * std::sqrt(chi2_exceeded_with(kTail)),
          .max_m = u_m * std::sqrt(chi2_exceeded_with(kTail / static_cast<double>(places)))};
}

}  // namespace abbe::calib::verify
