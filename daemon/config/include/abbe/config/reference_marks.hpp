#pragma once
/// The distance-coded reference marks of the scales. Pure data.

#include <chrono>
#include <string>
#include <vector>

#include "abbe/drivers/sampling/distance_code.hpp"

namespace abbe::daemon {

/// The marks of the scale of one axis, with
///
///   reading at a mark = zero_mark + position of the mark on the scale
///   reversed:           zero_mark - position of the mark on the scale
struct AxisMarks {
  std::string axis;
  drivers::DistanceCode code;
  double signal_period = 20e-6;  ///< signal period of the scale, m or rad
  double zero_mark = 0.0;        ///< reading at the zero mark of the scale, m or rad
  bool reversed = false;         ///< position on the scale ascends while the reading descends
};

struct ReferenceMarks {
  /// the axes that the card latches, in the order of its channels; each is one of counted_axes()
  std::vector<AxisMarks> axes;
  /// Standard uncertainty of the time offset between the scans of the two cards.
  std::chrono::nanoseconds u_alignment{std::chrono::milliseconds{1}};
  /// largest difference between the counts of the two cards, m or rad
  double tolerance_m = 1e-6;
};

}  // namespace abbe::daemon
