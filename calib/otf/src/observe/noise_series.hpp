#pragma once
/// What the noise of the tracker's readings does to the rows of a run, in the order of time.

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

/// Rows of consecutive segments whose means over [begin, end] are known.
struct NoiseSegment {
  double begin = 0.0, end = 0.0;  ///< s; in units of a segment for segments without times
  std::size_t leg = 0;
  std::size_t first_row = 0, rows = 0;
};

/// Rows in units of their white noise.
struct NoiseSeries {
  std::vector<NoiseSegment> segments;
  std::vector<NoiseResponse> response;  ///< by row: change per m or rad of the source
  std::size_t sources = kNoiseSources;  ///< used

  [[nodiscard]] double duration() const { return segments.back().end - segments.front().begin; }
  [[nodiscard]] double segment_duration() const {
    return segments.front().end - segments.front().begin;
  }
};
/// For observations with rows.
[[nodiscard]] NoiseSeries noise_series(const Observations&);

/// Sums over groups of segments that adjoin on a leg, divided by the root of their number: the
/// white noise keeps its variance.
struct GroupedSeries {
  NoiseSeries series;
  std::vector<std::vector<std::size_t>> rows;  ///< rows of each sum

  /// The same sums of other values of the rows.
  [[nodiscard]] RowMatrix sums(const RowMatrix& of_rows) const;
};
/// The segments of a group travel at most `group_m`; one segment alone if it travels more.
[[nodiscard]] GroupedSeries grouped(const NoiseSeries&, const Observations&, double group_m);

}  // namespace abbe::calib::otf
