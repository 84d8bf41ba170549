#include "abbe/calib/verify/expanded_uncertainty.hpp"

#include <cmath>

#include "abbe/calib/internal/statistics/chi2_tail.hpp"

namespace abbe::calib::verify {
namespace {

/// The value that |e|^2 / u^2 exceeds with the probability `tail`, computed by bisection.
double squares_exceeded_with(double tail) {
  constexpr double kCoordinates = 3.0;
  constexpr std::size_t kCauses = 1;
  constexpr int kHalvings = 60;
  const double log_tail = std::log(tail);
  double low = 0.0, high = 1.0;
  while (log_chi2_tail(high, kCauses) > log_tail) {
    high *= 2.0;
  }

  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (log_chi2_tail(middle, kCauses) > log_tail ? low : high) = middle;
  }
  return kCoordinates * high;
}

}  // namespace

ResidualU expanded_uncertainty(double u_m, std::size_t places) {
  constexpr double kTail = 0.05;
  return {.rms_m = u_m * std::sqrt(squares_exceeded_with(kTail)),
          .max_m = u_m * std::sqrt(squares_exceeded_with(kTail / static_cast<double>(places)))};
}

}  // namespace abbe::calib::verify
