#pragma once
/// Effect of the noise of the tracker's readings on the rows of a run, in the order of time.

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "abbe/calib/otf/observe/observe.hpp"

namespace abbe::calib::otf {

/// Sources of slow noise: range, azimuth, elevation, scale readings.
inline constexpr std::size_t kNoiseSources = 4;
using NoiseResponse = std::array<double, kNoiseSources>;
using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The rows of one segment. The time interval of a segment is [begin, end]; its rows are means over
/// it.
struct NoiseSegment {
  double begin = 0.0, end = 0.0;  ///< s; in units of a segment for segments without times
  std::size_t leg = 0;
  std::size_t first_row = 0, rows = 0;
};

/// The rows of a run, divided by their white noise.
struct NoiseSeries {
  std::vector<NoiseSegment> segments;
  std::vector<NoiseResponse> response;  ///< for each row: change per m or rad of each source
  std::size_t sources = kNoiseSources;  ///< number of sources used

  [[nodiscard]] double duration() const { return segments.back().end - segments.front().begin; }
  [[nodiscard]] double segment_duration() const {
    return segments.front().end - segments.front().begin;
  }
};
/// Makes the series. The observations must have rows.
[[nodiscard]] NoiseSeries noise_series(const Observations&);

/// Sums over groups of consecutive segments of a leg, divided by the square root of their number,
/// so that the variance of the white noise does not change.
struct GroupedSeries {
  NoiseSeries series;
  std::vector<std::vector<std::size_t>> rows;  ///< indices of the rows in each sum

  /// The same sums for other values of the rows, for example residuals.
  [[nodiscard]] RowMatrix sums(const RowMatrix& of_rows) const;
};
/// Groups the segments: a group travels at most `group_m`, or is a single segment that travels
/// more.
[[nodiscard]] GroupedSeries grouped(const NoiseSeries&, const Observations&, double group_m);

}  // namespace abbe::calib::otf
