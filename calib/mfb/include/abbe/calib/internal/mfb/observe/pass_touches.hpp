#pragma once
/// Sorts the touches of one pass by feature and checks the features against the bar.

#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"
#include "abbe/calib/mfb/run/points_of_interest.hpp"

namespace abbe::calib::mfb {

/// The used touches of a pass, in the order of nominal_touches() (the fixed order).
struct SortedTouches {
  std::vector<std::size_t> place;  ///< index in nominal_touches(), ascending
  std::vector<Vector3> tip_m;      ///< reading + tool offset
  std::vector<double> time;        ///< 0 to 1 within the pass
};

/// Sorts the touches. BadInput for a touch that the pattern does not have or a repeated one,
/// NotFinite, TooFewObservations for a feature with too few touches; the text begins with the name
/// of the measurement.
[[nodiscard]] Result<SortedTouches> sorted_touches(const TouchPattern&, const Measurement&,
                                                   const PassTouches&);

/// The features of the pattern with the touches at these places (one point per place).
[[nodiscard]] BarTouches bar_touches(const TouchPattern&, std::span<const std::size_t> places,
                                     std::span<const Vector3> points_m);

/// Compares the fitted features with the pattern. NotApplicable if a radius differs from the
/// nominal one by more than the limits, or if a feature is at another place in the frame of the
/// bar. The text begins with the feature, such as "hole 3: ...".
[[nodiscard]] Result<void> check_features(const BarFeatures&, const TouchPattern&,
                                          double tip_radius_m, const BarPose&,
                                          const ObserveLimits&);

/// Features of a bar, its frame as points_of_interest() defines it, and the points O_i in the frame
/// of the touches.
struct ExtractedBar {
  BarFeatures features;
  std::vector<Vector3> O_m;
  BarPose pose;
};
[[nodiscard]] Result<ExtractedBar> extracted(const BarTouches&, const Matrix3& axes);

}  // namespace abbe::calib::mfb
