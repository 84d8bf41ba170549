#pragma once
/// Drift of the tracker during a run, estimated from visits of reference nests and from the rows of
/// the run. The tracker measures a fixed point p as
///     p + d(t) + e,   d(t) = sum_k h_k(t) (c_k + w_k x p / L)
/// h_k: hat functions of evenly spaced knots in time, c_k: translation, w_k / L: rotation about the
/// tracker (only if three nests that are not on a line were visited at least twice), L: mean range,
/// e: noise of the visit and repeatability of the nest. The drift is zero at the first visit. The
/// position of each nest is unknown. The prior of every component is one of four courses (functions
/// of time), with s = t / T and s' = t' / T from the first visit, T: duration of the run, and m, M
/// = min, max(|s|, |s'|). Terms with m are 0 if the first visit is between t and t'.
///     curved:     cov = a^2 (s s' + (s s')^2 + m^3 (10 M^2 - 5 M m + m^2) / 6)
///     smooth:     cov = a^2 (s s' + m^2 (3 M - m) / 2)
///     with walk:  cov = that of smooth + w^2 m,   w = a / 8 or w = a
/// All courses contain a rate with the standard deviation a / T. Curved: also a curvature, and a
/// random walk that is integrated twice. Smooth: also a random walk that is integrated once, with
/// the standard deviation a after T. With walk: as smooth, and also a random walk.
///
/// The coefficients are additional unknowns of the adjustment of U (solve.hpp): the rows of the run
/// depend on them as on U; the visits and the prior add information about them. The course, the
/// amplitude a and the factor of the stated repeatability (1, 2, 4 or 8) are not known: the
/// estimate is the mean over all, weighted with their marginal likelihood, and the covariance
/// contains their uncertainty. Nests that contradict one another, or the run, thus get less weight.
///
/// Between two knots a random walk is not straight. Its deviation from the straight line is not
/// estimated, but its effect is part of the covariance of U (DriftBasis::append_between_knots).
///
/// The same likelihood finds a nest that was moved between two visits, or one wrong visit: the
/// visits of a moved nest have two positions instead of one.

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/otf/samples/nest_visits.hpp"

namespace abbe::calib::otf {

/// Data of a run for estimating the drift.
struct DriftObservations {
  std::vector<double> knots_s{};    ///< ascending, tracker clock
  std::size_t zero = 0;             ///< index of the knot at the first visit, where the drift is 0
  std::vector<double> segment_s{};  ///< mean time of each segment, by Observation::segment
  std::vector<NestVisit> visits{};
  std::vector<std::string> names{};  ///< names of the nests
  double u_repeatability_m = 0.0;
  bool rotates = false;
  double length_m = 1.0;  ///< mean range L
};

struct DriftPoint {
  double time_s = 0.0;                ///< time of the tracker's clock
  Vector3 value_m = Vector3::Zero();  ///< apparent motion of the centre of the path, machine axes
};

/// The estimated drift.
struct TrackerDrift {
  Eigen::VectorXd coefficients;      ///< coefficients of the hat functions, without the knot at the
                                     ///< first visit
  std::vector<DriftPoint> points{};  ///< one point at each knot
  std::size_t visits = 0;            ///< number of used visits
  /// Standard uncertainty with which the visits were used: root mean square over the factors of the
  /// stated repeatability.
  double u_repeatability_m = 0.0;
  double walk_m = 0.0;  ///< standard deviation of a random walk over the run, per axis; 0: none
  std::vector<std::string> notes{};  ///< notes for the verdict

  /// For each machine axis the value of `points` with the largest absolute value.
  [[nodiscard]] Vector3 largest_m() const;
};

}  // namespace abbe::calib::otf
