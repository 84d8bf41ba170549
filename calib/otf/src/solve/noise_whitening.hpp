#pragma once
/// The Kalman filter of the slow noise (prewhitening.hpp): it predicts the noise of each row from
/// all earlier rows.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/internal/otf/solve/prewhitening.hpp"
#include "observe/noise_series.hpp"

namespace abbe::calib::otf {

/// Slow noise, divided by the white noise of the rows.
struct SlowNoise {
  std::array<double, kNoiseSources> variance{};  ///< in m^2 or rad^2
  double correlation_time = 1.0;
};

/// Transition of an Ornstein-Uhlenbeck process of variance 1 over a time in which its mean is m:
/// x_end = keep x_begin + noise, m = mean x_begin + noise.
struct SlowNoiseStep {
  double keep = 1.0, mean = 1.0;
  double variance_x = 0.0, covariance = 0.0, variance_m = 0.0;  ///< variances and covariance of
                                                                ///< this noise in x_end and m
  [[nodiscard]] double stationary_variance_m() const { return mean * mean + variance_m; }
};
[[nodiscard]] SlowNoiseStep slow_noise_step(double duration, double correlation_time);

class NoiseWhitening {
 public:
  /// Computes the filter. `series` must outlive this object.
  NoiseWhitening(const NoiseSeries& series, const SlowNoise&);

  /// Replaces rows, which are divided by their white noise, by (row - prediction) / standard
  /// deviation of the prediction.
  void apply(RowMatrix& rows) const;
  /// Logarithm of the variance of the prediction for each row; their sum is log |V|.
  [[nodiscard]] std::span<const double> log_variance() const { return log_variance_; }
  /// Mean variance of the rows without prediction.
  [[nodiscard]] double mean_variance() const { return mean_variance_; }

 private:
  struct Gain {
    NoiseResponse response{}, x{}, m{};
    double inverse_root = 1.0;
  };
  struct Prediction {
    double through_gap = 1.0, keep = 1.0, mean = 1.0;
  };

  const NoiseSeries& series_;
  std::vector<Prediction> predictions_;  ///< one for each segment
  std::vector<Gain> gains_;              ///< one for each row
  std::vector<double> log_variance_;
  double mean_variance_ = 1.0;
};

}  // namespace abbe::calib::otf
