#pragma once
/// Segments: means of consecutive tracker samples. A segment mean is the average of the machine's
/// path over the segment, not the point of the path at mid-time. A quantity that is compared with a
/// segment must therefore be averaged over the sub-points of the segment.

#include <span>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"
#include "abbe/calib/otf/run/set_aside.hpp"

namespace abbe::calib::otf {

struct Segment {
  Vector3 mean_tracker_m = Vector3::Zero();
  /// Number of valid samples in the mean. 0: the beam was lost; the segment only marks the time.
  std::size_t samples = 0;
  bool usable = false;  ///< at least half of the samples are valid: used in the adjustment
  /// Index of the first sub-point in SegmentSeries::sub_points_tracker_m. A usable segment has
  /// SegmentSeries::sub_points of them.
  std::size_t first_sub_point = 0;
  /// Tracker clock: mean, first and last time of the samples in the mean; 0 without times.
  double time_s = 0.0, first_s = 0.0, last_s = 0.0;
  /// Range of the indices of its samples, valid or invalid. Both are 0 if the segment was made from
  /// a mean.
  std::size_t begin_sample = 0, end_sample = 0;
  /// Standard deviation of its samples relative to that of the other samples of the run, if it is
  /// much larger (aligned_segments.hpp); else 1.
  double noise_factor = 1.0;

  /// Number of samples with the noise of the run whose mean would have the same uncertainty as this
  /// segment.
  [[nodiscard]] double effective_samples() const {
    return static_cast<double>(samples) / (noise_factor * noise_factor);
  }
};

/// Segments of equal duration, in the order of time.
struct SegmentSeries {
  std::vector<Segment> segments;
  std::vector<Vector3> sub_points_tracker_m;  ///< sub-points of every usable segment, evenly spaced
  /// Number of sub-points per segment: Options::row_points, or fewer if a segment has fewer
  /// samples.
  std::size_t sub_points = 0;
  Vector3 start_tracker_m = Vector3::Zero();  ///< mean of the standstill at the first vertex
  Vector3 end_tracker_m = Vector3::Zero();    ///< mean of the standstill at the last vertex
  std::size_t samples = 0;
  std::size_t lost_samples = 0;  ///< invalid samples, and samples missing in the time series
  double first_time_s = 0.0;     ///< time of the first sample, tracker clock
  double period_s = 0.0;         ///< median time between samples; 0: segments without times
  /// Segments in which the beam returned after at least five lost samples, ascending.
  std::vector<std::size_t> beam_returned{};
  SetAside set_aside{};  ///< samples excluded by aligned_segments(); they are not in `lost_samples`
};

inline constexpr double kSegmentTravel_m = 8.33e-3;

/// Number of samples per segment, 1 to 1000, for which the target travels 8.3 mm in a segment. This
/// length is small compared with nodes 50 mm apart; it is also the length used to re-evaluate
/// [Sanders 2023] (100 samples at 500 Hz and 2500 mm/min). The travel per sample is computed from
/// chords over 50 samples, so that noise does not increase it; if such a chord is longer than a
/// segment, fewer samples are used. The upper quartile of the chords is used, so that standstill
/// and acceleration ramps have no influence.
[[nodiscard]] std::size_t suitable_segment_samples(std::span<const TrackerObservation>);
/// Number of samples per segment for a known travel from one sample to the next. 1000 if the travel
/// is 0 or not a number.
[[nodiscard]] std::size_t segment_samples_for_travel(double travel_per_sample_m);

/// Makes the segments. NotFinite if a valid sample contains NaN (the text names the sample).
/// BadInput if time does not ascend, has a gap of more than one hour, or an option is 0.
/// TooFewObservations for fewer than four segments, fewer samples than the two standstills need, or
/// no valid sample.
[[nodiscard]] Result<SegmentSeries> make_segments(std::span<const TrackerObservation>,
                                                  const Options&);

/// Makes segments from their means only, for a recording without the single samples. The sub-points
/// of a segment are spaced around its mean along the direction of travel.
[[nodiscard]] Result<SegmentSeries> segments_from_means(std::span<const Vector3> means_tracker_m,
                                                        const Vector3& start_tracker_m,
                                                        const Vector3& end_tracker_m,
                                                        const Options&);

}  // namespace abbe::calib::otf
