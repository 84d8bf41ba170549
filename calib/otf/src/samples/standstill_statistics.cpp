#include "samples/standstill_statistics.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/internal/statistics/quantile_999.hpp"

namespace abbe::calib::otf {
namespace {

/// Straight line through samples as a function of time: mean position and slope.
struct LinearFit {
  Vector3 mean = Vector3::Zero(), slope = Vector3::Zero();
  double mean_time_s = 0.0;

  [[nodiscard]] Vector3 residual(double time_s, const Vector3& p) const {
    return p - mean - (time_s - mean_time_s) * slope;
  }
};

LinearFit linear_fit(std::span<const double> time_s, std::span<const Vector3> points) {
  LinearFit fit;
  const auto n = static_cast<double>(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    fit.mean += points[i] / n;
    fit.mean_time_s += time_s[i] / n;
  }

  Vector3 moment = Vector3::Zero();
  double squares = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double t = time_s[i] - fit.mean_time_s;
    moment += t * (points[i] - fit.mean);
    squares += t * t;
  }

  if (squares > 0.0) {
    fit.slope = moment / squares;
  }
  return fit;
}

/// Range of component k that counts as noise: median and largest deviation from it.
struct Band {
  double centre = 0.0, half_width = 0.0;
};
Band noise_band(std::span<const Vector3> residuals, Eigen::Index k) {
  constexpr double kRobust = 5.0 * kMadToSigma;
  constexpr double kResolution_m = 1e-7;  // for a stream without noise
  std::vector<double> values;
  values.reserve(residuals.size());
  for (const Vector3& r : residuals) {
    values.push_back(r(k));
  }

  Band band;
  band.centre = median(values);
  for (double& v : values) {
    v = std::abs(v - band.centre);
  }
  band.half_width = std::max(kRobust * median(values), kResolution_m);
  return band;
}

/// Removes points whose deviation from the fit is larger than noise. Returns their number.
std::size_t remove_outliers(std::vector<double>& time_s, std::vector<Vector3>& points) {
  const LinearFit fit = linear_fit(time_s, points);
  std::vector<Vector3> residuals;
  residuals.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    residuals.push_back(fit.residual(time_s[i], points[i]));
  }

  std::array<Band, 3> bands;
  for (std::size_t k = 0; k < 3; ++k) {
    bands[k] = noise_band(residuals, static_cast<Eigen::Index>(k));
  }

  std::vector<double> kept_s;
  std::vector<Vector3> kept;
  for (std::size_t i = 0; i < points.size(); ++i) {
    bool inside = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const double r = residuals[i](static_cast<Eigen::Index>(k));
      inside = inside && std::abs(r - bands[k].centre) <= bands[k].half_width;
    }
    if (inside) {
      kept_s.push_back(time_s[i]);
      kept.push_back(points[i]);
    }
  }

  constexpr std::size_t kFewest = 3;
  if (kept.size() < kFewest) {  // no points remain that are within the noise in all three
                                // components
    return 0;
  }

  const std::size_t removed = points.size() - kept.size();
  time_s = std::move(kept_s);
  points = std::move(kept);
  return removed;
}

/// Variance of the residuals after subtraction of mean and creep.
Vector3 variance(std::span<const Vector3> residuals) {
  Vector3 squares = Vector3::Zero();
  for (const Vector3& r : residuals) {
    squares += r.cwiseProduct(r);
  }
  constexpr std::size_t kFitted = 2;  // mean and slope
  return squares / static_cast<double>(std::max(residuals.size(), kFitted + 1) - kFitted);
}

}  // namespace

Matrix3 beam_axes(const Vector3& p_tracker_m) {
  const Vector3 beam = p_tracker_m.normalized();
  Vector3 horizontal = Vector3::UnitZ().cross(beam);
  constexpr double kVertical = 1e-6;
  if (horizontal.norm() < kVertical) {
    horizontal = Vector3::UnitX() - beam.x() * beam;
  }
  horizontal.normalize();
  Matrix3 axes;
  axes << beam, horizontal, beam.cross(horizontal);
  return axes;
}

StandstillSamples standstill_of(std::span<const TrackerObservation> samples,
                                std::span<const double> time_s, std::size_t first,
                                std::size_t last) {
  StandstillSamples all;
  Standstill& s = all.standstill;
  s.first_sample = first;
  s.last_sample = last;
  s.begin_s = time_s[first];
  s.end_s = time_s[last];
  std::vector<double> times_s;
  std::vector<Vector3> points;
  Vector3 origin = Vector3::Zero();

  for (std::size_t i = first; i <= last; ++i) {
    if (!samples[i].valid) {
      ++s.lost_samples;
      continue;
    }
    if (points.empty()) {
      origin = samples[i].p_tracker_m;
      s.axes_tracker = beam_axes(origin);
    }
    times_s.push_back(time_s[i]);
    points.emplace_back(s.axes_tracker.transpose() * (samples[i].p_tracker_m - origin));
  }

  s.outliers = remove_outliers(times_s, points);
  s.samples = points.size();
  const LinearFit fit = linear_fit(times_s, points);
  s.mean_tracker_m = origin + s.axes_tracker * fit.mean;
  s.creep_m = (s.end_s - s.begin_s) * fit.slope;

  all.residual_m.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    all.residual_m.push_back(fit.residual(times_s[i], points[i]));
  }
  s.scatter_m = variance(all.residual_m).cwiseSqrt();

  return all;
}

void MeanVariances::add(std::span<const Vector3> residual_m) {
  // The subtracted creep is nearly a linear motion of the means. Their degrees of freedom are
  // therefore their number minus two.
  constexpr std::size_t kFewestMeans = 6, kFitted = 2;
  const Vector3 of_samples = variance(residual_m);
  std::vector<Vector3> means(residual_m.begin(), residual_m.end());

  for (std::size_t level = 0, m = 1; means.size() >= kFewestMeans; ++level, m *= 2) {
    if (level == levels_.size()) {
      levels_.emplace_back();
    }
    Vector3 centre = Vector3::Zero(), squares = Vector3::Zero();
    for (const Vector3& v : means) {
      centre += v / static_cast<double>(means.size());
    }
    for (const Vector3& v : means) {
      squares += (v - centre).cwiseProduct(v - centre);
    }

    const auto dof = static_cast<double>(means.size() - kFitted);
    levels_[level].of_means += static_cast<double>(m) * squares;
    levels_[level].of_samples += dof * of_samples;
    levels_[level].degrees_of_freedom += dof;

    for (std::size_t i = 0; i < means.size() / 2; ++i) {
      means[i] = 0.5 * (means[2 * i] + means[2 * i + 1]);
    }
    means.resize(means.size() / 2);
  }
}

Vector3 MeanVariances::correlation() const {
  Vector3 largest = Vector3::Ones();
  for (const Level& level : levels_) {
    const double unsuspicious = 1.0 + kNormal999 * std::sqrt(2.0 / level.degrees_of_freedom);
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double ratio = level.of_means(k) / level.of_samples(k);
      if (ratio > unsuspicious) {  // false for NaN
        largest(k) = std::max(largest(k), ratio);
      }
    }
  }
  return largest;
}

}  // namespace abbe::calib::otf
