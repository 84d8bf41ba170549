#include "observe/run_times.hpp"

#include <algorithm>

namespace abbe::calib::otf {

RunTimes times_of(const SegmentSeries& series) {
  RunTimes times{.begin_s = series.first_time_s, .end_s = series.first_time_s};
  for (const Segment& segment : series.segments) {
    times.of_segment_s.push_back(segment.time_s);
    times.end_s = std::max(times.end_s, segment.last_s);
  }
  return times;
}

RunTimes times_of(const Standstills& all) {
  RunTimes times{.begin_s = all.found.front().begin_s, .end_s = all.found.back().end_s};
  for (const Standstill& s : all.found) {
    times.of_segment_s.push_back(s.middle_s());
  }
  return times;
}

}  // namespace abbe::calib::otf
