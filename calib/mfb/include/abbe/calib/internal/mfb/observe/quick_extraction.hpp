#pragma once
/// Computes points of interest in little time, for many repetitions: without checks and covariance,
/// with fits that start at the nominal feature. The bar must be nearly where the pattern has it.
/// The result differs from that of points_of_interest() only by rounding.

#include <span>
#include <vector>

#include "abbe/calib/internal/mfb/observe/bar_points.hpp"
#include "abbe/calib/mfb/run/bar.hpp"

namespace abbe::calib::mfb {

class QuickExtraction {
 public:
  /// `places`: indices of the used touches in the fixed order (nominal_touches()).
  QuickExtraction(const TouchPattern&, double tip_radius_m, std::span<const std::size_t> places);

  /// Computes the points. `tips_m`: one per place, in bar axes. DegenerateGeometry: the axes do not
  /// meet the planes.
  [[nodiscard]] Result<BarPoints> operator()(std::span<const Vector3> tips_m);

 private:
  struct Group {
    std::size_t first = 0, count = 0;
    PointAndDirection nominal;
    double radius_m = 0.0;
  };
  std::vector<Group> holes_, rods_, planes_;
  std::vector<PointAndDirection> hole_axes_, rod_axes_, plane_normals_;
};

}  // namespace abbe::calib::mfb
