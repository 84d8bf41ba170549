#pragma once
/// The functions of time that represent the drift of the tracker (tracker_drift.hpp), and their
/// prior. The coefficients are ordered by knot, without the knot at the first visit: translation x,
/// y, z, then rotation x, y, z if it is estimated. All are in m (a rotation is multiplied by
/// DriftObservations::length_m). The translation and rotation components are called modes.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Courses of a drift, from the smoothest to the least smooth one (tracker_drift.hpp).
enum class DriftCourse { Curved, Smooth, SmallWalk, Walk };
inline constexpr std::array kDriftCourses{DriftCourse::Curved, DriftCourse::Smooth,
                                          DriftCourse::SmallWalk, DriftCourse::Walk};

/// Standard deviation of the random walk over the duration of the run, for the amplitude 1.
[[nodiscard]] double walk_of(DriftCourse);

class DriftBasis {
 public:
  /// `d` must outlive this object and have at least two knots.
  explicit DriftBasis(const DriftObservations& d) : d_(d), modes_(d.rotates ? 6 : 3) {}

  [[nodiscard]] std::size_t modes() const { return modes_; }
  [[nodiscard]] std::size_t size() const { return modes_ * (d_.knots_s.size() - 1); }

  /// Derivative of the measured position with respect to the coefficients, 3 x size(), for a point
  /// at p in the tracker frame.
  [[nodiscard]] Eigen::MatrixXd dp_dc(double time_s, const Vector3& p_tracker_m) const;
  /// Components of dp_dc() along a direction of the tracker frame: appends the non-zero entries, at
  /// most 2 modes(), to `out`. `first`: column of the first coefficient.
  void append_along(const Vector3& direction_tracker, double time_s, const Vector3& p_tracker_m,
                    std::size_t first, std::vector<SparseRows::Entry>& out) const;
  /// Lower triangular root of the prior covariance of one mode at the knots, for the amplitude 1.
  /// All modes have the same covariance and are independent.
  [[nodiscard]] Eigen::MatrixXd root_of_prior(DriftCourse) const;

  /// Number of coefficients that describe how a random walk deviates from straight lines between
  /// the knots: for each interval and mode the first kSines functions of its Karhunen-Loeve
  /// expansion,
  ///     b_j(tau) = sqrt(2 dt / T) sin(j pi tau) / (j pi),   j = 1, 2 .., tau: 0 to 1,   dt: interval
  /// with coefficients whose standard deviation is that of the walk over the duration T of the run.
  [[nodiscard]] std::size_t between_knots() const {
    return kSines * modes_ * (d_.knots_s.size() - 1);
  }
  /// Appends the non-zero entries of the coefficients between the knots along a direction of the
  /// tracker frame, kSines modes(), to `out`. `first`: column of the first coefficient.
  void append_between_knots(const Vector3& direction_tracker, double time_s,
                            const Vector3& p_tracker_m, std::size_t first,
                            std::vector<SparseRows::Entry>& out) const;

 private:
  static constexpr std::size_t kSines = 3;  ///< represent 83 % of the variance between the knots

  /// The interval between two knots that contains a time: index of the knot before it, and the
  /// position in the interval from 0 to 1.
  struct Interval {
    std::size_t before = 0;
    double tau = 0.0;
  };
  [[nodiscard]] Interval interval_of(double time_s) const;
  /// Weight of a knot in the drift at a time, and the index of the first coefficient of this knot.
  struct Share {
    std::size_t first = 0;
    double weight = 0.0;
  };
  [[nodiscard]] std::array<std::optional<Share>, 2> shares(double time_s) const;
  /// Effect of mode k along a direction of the tracker frame.
  [[nodiscard]] double along(std::size_t k, const Vector3& direction_tracker,
                             const Vector3& p_tracker_m) const;

  const DriftObservations& d_;
  std::size_t modes_;
};

}  // namespace abbe::calib::otf
