#pragma once
/// A straight line through points of which many may be wrong.

#include <cstddef>
#include <span>
#include <vector>

namespace abbe::calib::otf {

/// A straight line through points of which many may be wrong: the line of repeated medians. The
/// points are divided into kParts parts in their order; each part is replaced by its medians of x
/// and y. The slope is the median over the parts of the median slope to all other parts. The
/// intercept is the median of y - slope x.
class RobustLine {
 public:
  static constexpr std::size_t kParts = 15;

  /// `x` and `y` have the same size, which is not 0. x ascends except for wrong points.
  RobustLine(std::span<const double> x, std::span<const double> y);

  [[nodiscard]] double at(double x) const { return intercept_ + slope_ * x; }

 private:
  double slope_ = 0.0, intercept_ = 0.0;
};

}  // namespace abbe::calib::otf
