#pragma once
/// Finds the standstills in the stream of a laser tracker: time, place and scatter of the samples.
/// With the means of the valid samples in the windows before and after sample i,
///     speed = |mean after - mean before| / window
/// and its noise
///     sigma_speed = sigma sqrt(3 (1/n before + 1/n after)) / window,
/// sigma: noise of one coordinate of a sample, from second differences of the stream. The target
/// stands still at sample i if
///     speed <= max(stand_speed, 4 sigma_speed)
/// A sample far from its two neighbours, and a lost sample, belongs to no window. A standstill
/// continues over a short beam break if the target is at the same place after it.
///
/// Times are those of the tracker's clock. If all samples of a burst have the time of its delivery
/// (a few hundred ms between bursts, almost none within a burst), they are taken as equally spaced.
///
/// Pure; allocates; gives the same bits for the same input on every processor.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

/// One standstill. The three components of vectors along `axes` are: along the beam, across it
/// horizontally, across it vertically (in the tracker frame).
struct Standstill {
  std::size_t first_sample = 0, last_sample = 0;  ///< indices in the stream
  double begin_s = 0.0, end_s = 0.0;              ///< times of these samples
  std::size_t samples = 0;                        ///< number of samples in the mean
  std::size_t lost_samples = 0;                   ///< number of invalid samples
  std::size_t outliers = 0;  ///< number of samples more than five robust standard deviations from
                             ///< the others
  Vector3 mean_tracker_m = Vector3::Zero();
  Matrix3 axes_tracker = Matrix3::Identity();  ///< columns: unit vectors, tracker frame
  /// Standard deviation of one sample along `axes`, after subtraction of the linear creep.
  Vector3 scatter_m = Vector3::Zero();
  /// Linear motion from the first to the last sample along `axes`; least-squares fit.
  Vector3 creep_m = Vector3::Zero();

  [[nodiscard]] double middle_s() const { return 0.5 * (begin_s + end_s); }
};

struct Standstills {
  std::vector<Standstill> found;  ///< in the order of time
  /// Variance of a mean of samples of one standstill relative to that of independent samples, along
  /// the axes of Standstill, common to all of them: the largest ratio
  ///     m var(means of m samples) / var(samples),   m = 1, 2, 4, ...
  /// that is significant. At least 1. Noise that is slower than a standstill is not in it.
  Vector3 correlation = Vector3::Ones();
  double period_s = 0.0;             ///< time between two samples
  double sigma_m = 0.0;              ///< noise of one coordinate of a sample
  double speed_limit_m_per_s = 0.0;  ///< for windows without a lost sample: below this speed the
                                     ///< target stands still
  std::size_t samples = 0;
  std::size_t lost_samples = 0;  ///< number of invalid samples
  std::size_t too_short = 0;     ///< number of stops shorter than least_duration_s
  std::size_t creeping = 0;      ///< number of slow motions that exceed most_creep_m
};

/// Finds the standstills. NotFinite or BadInput for samples that are not numbers or whose time does
/// not ascend (the text names sample and time). TooFewObservations for a stream without a
/// standstill.
[[nodiscard]] Result<Standstills> find_standstills(std::span<const TrackerObservation>,
                                                   const StandstillOptions& = {});

}  // namespace abbe::calib::otf
