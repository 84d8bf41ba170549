#pragma once
/// Drift of the tracker during a run, from visits of reference nests and from the run itself. The
/// tracker measures a fixed point p as
///     p + d(t) + e,   d(t) = sum_k h_k(t) (c_k + w_k x p / L)
/// h_k: hat functions of evenly spaced knots in time, c_k: translation, w_k / L: rotation about the
/// tracker (only if three nests that are not on a line were visited at least twice), L: mean range,
/// e: noise of the visit and repeatability of the nest. The drift is zero at the first visit. The
/// position of each nest is unknown. The prior of every component is one of four courses, with
/// s = t / T and s' = t' / T from the first visit, T: duration of the run, and m, M = min, max(|s|,
/// |s'|). Terms with m are 0 if the first visit is between t and t'.
///     curved:     cov = a^2 (s s' + (s s')^2 + m^3 (10 M^2 - 5 M m + m^2) / 6)
///     smooth:     cov = a^2 (s s' + m^2 (3 M - m) / 2)
///     with walk:  cov = that of smooth + w^2 m,   w = a / 8 or w = a
/// All: a rate of standard deviation a / T. Curved: also a curvature, and a random walk that is
/// integrated twice; smooth: a random walk that is integrated once, of the standard deviation a
/// after T; with walk: also a random walk.
///
/// The coefficients are added unknowns of the adjustment of U (solve.hpp): the rows of the run see
/// them as they see U, the visits and the prior add information about them. The course, the
/// amplitude a and the factor of the stated repeatability (1, 2, 4 or 8) are not known: the
/// estimate is the mean over all, weighted with their marginal likelihood, and the covariance
/// contains their uncertainty. So nests that contradict one another, or the run, count less.
///
/// Between two knots a random walk is not straight. What it does there is not estimated: the
/// covariance of U contains it (DriftBasis::append_between_knots).
///
/// A nest that was moved between two visits, or one visit that is wrong, is found by the same
/// likelihood: the visits of a moved nest belong to two positions.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/otf/samples/nest_visits.hpp"

namespace abbe::calib::otf {

/// What an adjustment needs for the drift.
struct DriftObservations {
  std::vector<double> knots_s{};    ///< ascending, tracker clock
  std::size_t zero = 0;             ///< the knot at the first visit: the drift there is 0
  std::vector<double> segment_s{};  ///< mean time by Observation::segment
  std::vector<NestVisit> visits{};
  std::vector<std::string> names{};  ///< of the nests
  double u_repeatability_m = 0.0;
  bool rotates = false;
  double length_m = 1.0;  ///< L
};

struct DriftPoint {
  double time_s = 0.0;                ///< tracker clock
  Vector3 value_m = Vector3::Zero();  ///< apparent motion of the centre of the path, machine axes
};

/// The estimated drift.
struct TrackerDrift {
  Eigen::VectorXd coefficients;      ///< of the hat functions, without those of the zero
  std::vector<DriftPoint> points{};  ///< at the knots
  std::size_t visits = 0;            ///< used
  /// Standard uncertainty with which the visits were used, root mean square over its factors.
  double u_repeatability_m = 0.0;
  double walk_m = 0.0;  ///< standard deviation of a random walk over the run, per axis; 0: none
  std::vector<std::string> notes{};  ///< for the verdict

  /// For each machine axis the value with the largest absolute value.
  [[nodiscard]] Vector3 largest_m() const;
};

}  // namespace abbe::calib::otf
