#include "solve/noise_whitening.hpp"

#include <cmath>

#include "abbe/calib/internal/statistics/elementary.hpp"

namespace abbe::calib::otf {
namespace {

using Matrix = std::array<std::array<double, kNoiseSources>, kNoiseSources>;

/// Joint covariance of the slow noise x at the end of a segment and of its mean m over the segment,
/// for the first n sources.
class Covariance {
 public:
  explicit Covariance(std::size_t n) : n_(n) {
    for (std::size_t s = 0; s < n; ++s) {
      xx_[s][s] = 1.0;  // the process is stationary
    }
  }

  void predict_through_gap(const SlowNoiseStep& gap) {
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) {
        xx_[i][j] = gap.keep * gap.keep * xx_[i][j] + (i == j ? gap.variance_x : 0.0);
      }
    }
  }
  void predict_over_segment(const SlowNoiseStep& step) {
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) {
        const double P = xx_[i][j], unit = i == j ? 1.0 : 0.0;
        xx_[i][j] = step.keep * step.keep * P + unit * step.variance_x;
        xm_[i][j] = step.keep * step.mean * P + unit * step.covariance;
        mm_[i][j] = step.mean * step.mean * P + unit * step.variance_m;
      }
    }
  }

  struct Update {
    double variance = 1.0;   ///< variance of the prediction of the row
    NoiseResponse x{}, m{};  ///< Kalman gains of x and m
  };
  /// Updates with a row that contains `response` . m and white noise of variance 1.
  Update update(const NoiseResponse& response) {
    const NoiseResponse x = product(xm_, response), m = product(mm_, response);
    Update u;
    for (std::size_t s = 0; s < n_; ++s) {
      u.variance += response[s] * m[s];
    }
    for (std::size_t s = 0; s < n_; ++s) {
      u.x[s] = x[s] / u.variance;
      u.m[s] = m[s] / u.variance;
    }
    subtract(xx_, x, u.x);
    subtract(xm_, x, u.m);
    subtract(mm_, m, u.m);
    return u;
  }

 private:
  [[nodiscard]] NoiseResponse product(const Matrix& A, const NoiseResponse& b) const {
    NoiseResponse c{};
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) {
        c[i] += A[i][j] * b[j];
      }
    }
    return c;
  }
  /// Subtracts the matrix a b^T.
  void subtract(Matrix& from, const NoiseResponse& a, const NoiseResponse& b) const {
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j < n_; ++j) {
        from[i][j] -= a[i] * b[j];
      }
    }
  }

  std::size_t n_;
  Matrix xx_{}, xm_{}, mm_{};
};

/// Steps of the noise for each duration; durations repeat, so that each step is computed once.
class Steps {
 public:
  explicit Steps(double correlation_time) : correlation_time_(correlation_time) {}

  const SlowNoiseStep& over(double duration) {
    if (duration != last_) {
      last_ = duration;
      step_ = slow_noise_step(duration, correlation_time_);
    }
    return step_;
  }

 private:
  double correlation_time_, last_ = -1.0;
  SlowNoiseStep step_;
};

}  // namespace

SlowNoiseStep slow_noise_step(double duration, double correlation_time) {
  const double x = duration / correlation_time;
  if (!(x > 0.0)) {
    return {};
  }
  SlowNoiseStep step;
  step.keep = exponential(-x);
  const double lost = 1.0 - step.keep;
  step.mean = lost / x;
  step.variance_x = 1.0 - step.keep * step.keep;
  step.covariance = lost * lost / x;
  step.variance_m = 2.0 * (x - lost) / (x * x) - step.mean * step.mean;
  return step;
}

NoiseWhitening::NoiseWhitening(const NoiseSeries& series, const SlowNoise& noise)
    : series_(series) {
  const std::size_t n = series.sources;
  NoiseResponse root{};
  for (std::size_t s = 0; s < n; ++s) {
    root[s] = std::sqrt(noise.variance[s]);
  }

  Covariance covariance(n);
  Steps through_gap(noise.correlation_time), over_segment(noise.correlation_time);
  predictions_.reserve(series.segments.size());
  gains_.reserve(series.response.size());
  log_variance_.reserve(series.response.size());
  double variances = 0.0, end = series.segments.front().begin;

  for (const NoiseSegment& b : series.segments) {
    constexpr double kNoGap = 1e-3;  // relative to the segment: rounding of the times
    const double pause = b.begin - end, duration = b.end - b.begin;
    const SlowNoiseStep gap = pause > kNoGap * duration ? through_gap.over(pause) : SlowNoiseStep{};
    const SlowNoiseStep& step = over_segment.over(duration);
    end = b.end;
    covariance.predict_through_gap(gap);
    covariance.predict_over_segment(step);
    predictions_.push_back({gap.keep, step.keep, step.mean});

    for (std::size_t i = b.first_row; i < b.first_row + b.rows; ++i) {
      NoiseResponse response{};
      double slow = 0.0;
      for (std::size_t s = 0; s < n; ++s) {
        response[s] = root[s] * series.response[i][s];
        slow += response[s] * response[s];
      }
      variances += 1.0 + slow * step.stationary_variance_m();
      const Covariance::Update u = covariance.update(response);
      gains_.push_back({response, u.x, u.m, 1.0 / std::sqrt(u.variance)});
      log_variance_.push_back(natural_logarithm(u.variance));
    }
  }
  mean_variance_ = variances / static_cast<double>(gains_.size());
}

void NoiseWhitening::apply(RowMatrix& rows) const {
  const std::size_t n = series_.sources, columns = static_cast<std::size_t>(rows.cols());
  std::array<std::vector<double>, kNoiseSources> x, m;
  for (std::size_t s = 0; s < n; ++s) {
    x[s].assign(columns, 0.0);
    m[s].assign(columns, 0.0);
  }

  for (std::size_t k = 0; k < series_.segments.size(); ++k) {
    const NoiseSegment& b = series_.segments[k];
    const Prediction& p = predictions_[k];
    for (std::size_t s = 0; s < n; ++s) {
      const double to_m = p.mean * p.through_gap, to_x = p.keep * p.through_gap;
      for (std::size_t j = 0; j < columns; ++j) {
        m[s][j] = to_m * x[s][j];
        x[s][j] = to_x * x[s][j];
      }
    }

    for (std::size_t i = b.first_row; i < b.first_row + b.rows; ++i) {
      const Gain& gain = gains_[i];
      double* row = rows.data() + i * columns;
      for (std::size_t s = 0; s < n; ++s) {
        const double response = gain.response[s];
        for (std::size_t j = 0; j < columns; ++j) {
          row[j] -= response * m[s][j];
        }
      }
      for (std::size_t s = 0; s < n; ++s) {
        const double of_x = gain.x[s], of_m = gain.m[s];
        for (std::size_t j = 0; j < columns; ++j) {
          x[s][j] += of_x * row[j];
          m[s][j] += of_m * row[j];
        }
      }
      for (std::size_t j = 0; j < columns; ++j) {
        row[j] *= gain.inverse_root;
      }
    }
  }
}

}  // namespace abbe::calib::otf
