#pragma once
/// Begin and end of a run, and the times of its segments or standstills.

#include <vector>

#include "abbe/calib/internal/otf/samples/standstill.hpp"
#include "abbe/calib/otf/observe/segments.hpp"

namespace abbe::calib::otf {

/// Begin and end of a run, and the times of its segments or standstills, in the tracker's clock.
struct RunTimes {
  double begin_s = 0.0, end_s = 0.0;
  std::vector<double> of_segment_s{};  ///< time of each segment, by Observation::segment
};
[[nodiscard]] RunTimes times_of(const SegmentSeries&);
[[nodiscard]] RunTimes times_of(const Standstills&);

}  // namespace abbe::calib::otf
