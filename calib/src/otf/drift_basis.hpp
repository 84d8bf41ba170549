#pragma once
/// The functions of time of which the drift of the tracker consists (tracker_drift.hpp), and their
/// prior. Coefficients are ordered by knot, without the datum: translation x, y, z, then rotation
/// x, y, z if there is one; all in m (a rotation times DriftObservations::length_m).

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "abbe/calib/otf/observe.hpp"

namespace abbe::calib::otf {

class DriftBasis {
 public:
  /// `d` must outlive it. At least two knots.
  explicit DriftBasis(const DriftObservations& d) : d_(d), modes_(d.rotates ? 6 : 3) {}

  [[nodiscard]] std::size_t modes() const { return modes_; }
  [[nodiscard]] std::size_t size() const { return modes_ * (d_.knots_s.size() - 1); }

  /// Derivative of the measured position with respect to the coefficients, 3 x size(), for a point
  /// at p in the tracker frame.
  [[nodiscard]] Eigen::MatrixXd dp_dc(double time_s, const Vector3& p_tracker_m) const;
  /// The same along a direction of the tracker frame: appends the coefficients that have one, at
  /// most 2 modes(), to `out`. `first`: column of the first coefficient.
  void append_along(const Vector3& direction_tracker, double time_s, const Vector3& p_tracker_m,
                    std::size_t first, std::vector<SparseRows::Entry>& out) const;
  /// Lower triangular root of the covariance of one mode at the knots for the amplitude 1. All modes
  /// have the same, and are independent.
  [[nodiscard]] Eigen::MatrixXd root_of_prior() const;

 private:
  /// Share of a knot in the drift at a time; the first coefficient of the knot.
  struct Share {
    std::size_t first = 0;
    double weight = 0.0;
  };
  [[nodiscard]] std::array<std::optional<Share>, 2> shares(double time_s) const;

  const DriftObservations& d_;
  std::size_t modes_;
};

}  // namespace abbe::calib::otf
