#pragma once
/// Points of interest for many repetitions: no checks, no covariance, fits that begin at the
/// nominal feature. The touches are those of a bar that is nearly where the pattern has it; the
/// result differs from that of points_of_interest() by rounding.

#include <span>
#include <vector>

#include "abbe/calib/internal/mfb/observe/bar_points.hpp"
#include "abbe/calib/mfb/run/bar.hpp"

namespace abbe::calib::mfb {

class QuickExtraction {
 public:
  /// `places`: the touches that are used, in the fixed order.
  QuickExtraction(const TouchPattern&, double tip_radius_m, std::span<const std::size_t> places);

  /// `tips_m`: one per place, in bar axes. DegenerateGeometry: the axes do not meet the planes.
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
