#pragma once
/// Computes mean, scatter, creep and correlation of the samples of standstills.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/internal/otf/samples/standstill.hpp"

namespace abbe::calib::otf {

/// Unit vectors along the beam, horizontal across it and vertical across it, as columns; tracker
/// frame. `p_tracker_m` must not be zero.
[[nodiscard]] Matrix3 beam_axes(const Vector3& p_tracker_m);

/// A standstill with the residuals of its samples.
struct StandstillSamples {
  Standstill standstill;
  /// Residuals of the samples in the mean after subtraction of mean and creep, along
  /// Standstill::axes_tracker.
  std::vector<Vector3> residual_m;
};
/// Statistics of the valid samples in [first, last] without outliers. After subtraction of the
/// linear creep, an outlier deviates by more than five robust standard deviations from the median
/// in one component. At least one sample must be valid.
[[nodiscard]] StandstillSamples standstill_of(std::span<const TrackerObservation>,
                                              std::span<const double> time_s, std::size_t first,
                                              std::size_t last);

/// For m = 1, 2, 4, ...: sums over standstills of m times the variance of the means of m successive
/// samples. If the correlation of the noise extends over fewer than m samples, a mean of n samples
/// has the variance of n / m independent means of m.
class MeanVariances {
 public:
  void add(std::span<const Vector3> residual_m);
  /// Largest significant ratio, as defined at Standstills::correlation.
  [[nodiscard]] Vector3 correlation() const;

 private:
  struct Level {
    Vector3 of_means = Vector3::Zero();    ///< sum of degrees of freedom times m var(means of m)
    Vector3 of_samples = Vector3::Zero();  ///< sum of the same degrees of freedom times
                                           ///< var(samples)
    double degrees_of_freedom = 0.0;
  };
  std::vector<Level> levels_;
};

}  // namespace abbe::calib::otf
