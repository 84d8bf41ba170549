#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"
#include "abbe/calib/otf/solve/residual_noise.hpp"

namespace abbe::calib::otf {
namespace {

/// End of the series of neighbouring points that begins with row `begin`. A series is a leg, or all
/// positions of a run in standstill mode.
std::size_t series_end(const Observations& o, std::size_t begin) {
  if (o.mode == Mode::Standstill) {
    return o.rows.size();
  }
  std::size_t end = begin;
  while (end < o.rows.size() && o.rows[end].leg == o.rows[begin].leg) {
    ++end;
  }
  return end;
}

/// Whitened residuals of a series in one direction, for example along a2.
std::vector<double> whitened(const Observations& o, std::span<const double> residual_m,
                             std::size_t begin, std::size_t end, std::size_t component) {
  std::vector<double> w;
  for (std::size_t i = begin; i < end; ++i) {
    if (o.rows[i].component == component) {
      w.push_back(residual_m[i] / o.rows[i].sigma_m);
    }
  }
  return w;
}

}  // namespace

double ResidualNoise::variance_factor() const {
  return std::max(1.0, sigma0 * sigma0 * correlation);
}

ResidualNoise residual_noise(const Observations& o, std::span<const double> residual_m,
                             std::size_t degrees_of_freedom, std::optional<std::size_t> of) {
  constexpr std::size_t kMostLags = 200;
  std::vector<double> products(kMostLags + 1, 0.0), second_differences;
  std::vector<std::size_t> pairs(kMostLags + 1, 0);

  for (std::size_t begin = 0; begin < o.rows.size();) {
    const std::size_t end = series_end(o, begin);
    for (std::size_t c = of ? *of : 0; c <= (of ? *of : kAlong); ++c) {
      const std::vector<double> w = whitened(o, residual_m, begin, end, c);
      for (std::size_t i = 0; i < w.size(); ++i) {
        for (std::size_t lag = 0; lag <= std::min(kMostLags, i); ++lag) {
          products[lag] += w[i] * w[i - lag];
          ++pairs[lag];
        }
        if (i >= 2) {
          second_differences.push_back(std::abs(w[i] - 2.0 * w[i - 1] + w[i - 2]));
        }
      }
    }

    begin = end;
  }

  constexpr double kOfSecondDifference = 6.0;  // variance of a second difference: 1 + 4 + 1
  ResidualNoise noise;
  noise.sigma0 =
      std::sqrt(products[0] / static_cast<double>(std::max<std::size_t>(1, degrees_of_freedom)));
  constexpr std::size_t kEnough = 30;  // with fewer values, fast and slow noise cannot be separated
  const bool enough = second_differences.size() >= kEnough;
  noise.local = !enough ? noise.sigma0
                        : kMadToSigma * median(second_differences) / std::sqrt(kOfSecondDifference);

  // Limit: 99.9 % quantile of the normal distribution. For white noise an autocorrelation
  // coefficient from n pairs has the standard deviation 1/sqrt(n).
  for (std::size_t lag = 1; lag <= kMostLags && pairs[lag] > 0; ++lag) {
    const auto n = static_cast<double>(pairs[lag]);
    const double coefficient = products[lag] / n / (products[0] / static_cast<double>(pairs[0]));
    if (!(coefficient > kNormal999 / std::sqrt(n))) {
      break;
    }
    noise.correlation += 2.0 * coefficient;
  }

  return noise;
}

}  // namespace abbe::calib::otf
