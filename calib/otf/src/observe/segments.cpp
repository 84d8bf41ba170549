#include "abbe/calib/otf/observe/segments.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kFewestSegments = 4;

Result<void> check(std::span<const TrackerObservation> samples, const Options& options) {
  if (options.segment_samples < 1 || options.row_points < 1 || options.standstill_samples < 1) {
    return failure(ErrorCode::BadInput,
                   message("tracker segments: segment_samples ", options.segment_samples,
                           ", row_points ", options.row_points, ", standstill_samples ",
                           options.standstill_samples, ": each must be at least 1"));
  }

  const std::size_t needed =
      std::max(kFewestSegments * options.segment_samples, 2 * options.standstill_samples);
  if (samples.size() < needed) {
    return failure(ErrorCode::TooFewObservations, message("tracker segments: ", samples.size(),
                                                          " samples, needs at least ", needed));
  }

  for (std::size_t i = 0; i < samples.size(); ++i) {
    const TrackerObservation& s = samples[i];
    if (!std::isfinite(s.time_s) || (s.valid && !s.p_tracker_m.allFinite())) {
      return failure(ErrorCode::NotFinite,
                     message("tracker segments: sample ", i, " is not a number"));
    }
    if (i > 0 && !(s.time_s > samples[i - 1].time_s)) {
      return failure(ErrorCode::BadInput,
                     message("tracker segments: sample ", i, " at ", s.time_s, " s follows ",
                             samples[i - 1].time_s, " s, time must ascend"));
    }
  }

  return {};
}

double median_tick_s(std::span<const TrackerObservation> samples) {
  std::vector<double> ticks(samples.size() - 1);
  for (std::size_t i = 0; i < ticks.size(); ++i) {
    ticks[i] = samples[i + 1].time_s - samples[i].time_s;
  }
  return median(ticks);
}

/// Divides the samples of the tracker into segments of equal duration. A gap in time counts as lost
/// samples.
class SegmentCutter {
 public:
  SegmentCutter(std::size_t expected_segments, const Options& options) : options_(options) {
    series_.segments.reserve(expected_segments);
    series_.sub_points = std::min(options.row_points, options.segment_samples);
    series_.sub_points_tracker_m.reserve(expected_segments * series_.sub_points);
  }

  void add(const TrackerObservation& sample) {
    ++added_;
    if (sample.valid) {
      note_return();
      in_segment_.push_back(&sample.p_tracker_m);
      times_s_.push_back(sample.time_s);
    } else {
      ++series_.lost_samples;
      ++lost_in_a_row_;
    }
    step();
  }

  void lose(std::size_t ticks) {
    series_.lost_samples += ticks;
    lost_in_a_row_ += ticks;
    for (std::size_t i = 0; i < ticks; ++i) {
      step();
    }
  }

  [[nodiscard]] SegmentSeries take() { return std::move(series_); }

 private:
  void note_return() {
    constexpr std::size_t kBreak = 5;
    const std::size_t segment = series_.segments.size();
    std::vector<std::size_t>& returned = series_.beam_returned;
    if (lost_in_a_row_ >= kBreak && (returned.empty() || returned.back() != segment)) {
      returned.push_back(segment);
    }
    lost_in_a_row_ = 0;
  }

  void step() {
    if (++ticks_ == options_.segment_samples) {
      close();
    }
  }

  void close() {
    Segment segment;
    segment.samples = in_segment_.size();
    segment.begin_sample = closed_;
    segment.end_sample = closed_ = added_;
    for (const Vector3* p : in_segment_) {
      segment.mean_tracker_m += *p;
    }

    if (segment.samples > 0) {
      segment.mean_tracker_m /= static_cast<double>(segment.samples);
    }

    if (segment.samples > 0) {
      // relative to the first time, because the sum of absolute times would lose digits
      for (const double time_s : times_s_) {
        segment.time_s += time_s - times_s_.front();
      }
      segment.time_s = times_s_.front() + segment.time_s / static_cast<double>(segment.samples);
      segment.first_s = times_s_.front();
      segment.last_s = times_s_.back();
    }

    segment.usable = segment.samples > 0 && 2 * segment.samples >= options_.segment_samples;
    segment.first_sub_point = series_.sub_points_tracker_m.size();
    if (segment.usable) {
      push_sub_points();
    }

    series_.segments.push_back(segment);
    in_segment_.clear();
    times_s_.clear();
    ticks_ = 0;
  }

  /// Appends the midpoints of equal parts of the segment as sub-points. The mean of the midpoints
  /// is the mean of the segment; the mean of equally spaced points from end to end would not be. If
  /// there is one part per sample, the sub-points are the samples.
  void push_sub_points() {
    const double step =
        static_cast<double>(in_segment_.size()) / static_cast<double>(series_.sub_points);
    for (std::size_t k = 0; k < series_.sub_points; ++k) {
      const double place = (static_cast<double>(k) + 0.5) * step - 0.5;
      const auto i = static_cast<std::size_t>(std::max(0.0, std::floor(place)));
      const std::size_t next = std::min(i + 1, in_segment_.size() - 1);
      const double fraction = std::clamp(place - static_cast<double>(i), 0.0, 1.0);
      series_.sub_points_tracker_m.emplace_back((1.0 - fraction) * *in_segment_[i] +
                                                fraction * *in_segment_[next]);
    }
  }

  const Options& options_;
  SegmentSeries series_;
  std::vector<const Vector3*> in_segment_;
  std::vector<double> times_s_;  ///< times of the samples in in_segment_
  std::size_t ticks_ = 0;
  std::size_t added_ = 0, closed_ = 0;  ///< number of samples so far, and of samples in closed
                                        ///< segments
  std::size_t lost_in_a_row_ = 0;
};

/// Mean of the first valid samples in [begin, end): at most `count` samples, and only samples
/// before the machine has moved. A tracker with a low sample rate measures few points during a
/// short standstill; the mean of 20 points would then be far from the vertex.
template <class Iterator>
Result<Vector3> standstill(Iterator begin, Iterator end, std::size_t count) {
  constexpr double kMoved_m = 1e-3;  // more than noise, less than the limit of the alignment
  Vector3 first = Vector3::Zero(), sum = Vector3::Zero();
  std::size_t found = 0;

  for (; begin != end && found < count; ++begin) {
    if (!begin->valid) {
      continue;
    }
    if (found == 0) {
      first = begin->p_tracker_m;
    }
    if ((begin->p_tracker_m - first).norm() > kMoved_m) {
      break;
    }
    sum += begin->p_tracker_m;
    ++found;
  }

  if (found == 0) {
    return failure(ErrorCode::TooFewObservations, "tracker segments: no valid samples");
  }

  return Vector3(sum / static_cast<double>(found));
}

}  // namespace

Result<SegmentSeries> make_segments(std::span<const TrackerObservation> samples,
                                    const Options& options) {
  ABBE_TRY(check(samples, options));

  const Result<Vector3> start =
      standstill(samples.begin(), samples.end(), options.standstill_samples);
  const Result<Vector3> end =
      standstill(samples.rbegin(), samples.rend(), options.standstill_samples);

  if (!start || !end) {
    return tl::unexpected(start ? end.error() : start.error());
  }

  const double tick_s = median_tick_s(samples);
  // A longer pause is not part of one run; without this limit it would give millions of empty
  // segments.
  constexpr double kLongestGap_s = 3600.0;
  SegmentCutter cutter(samples.size() / options.segment_samples + 1, options);

  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i > 0) {
      const double step_s = samples[i].time_s - samples[i - 1].time_s;
      if (step_s > kLongestGap_s) {
        return failure(ErrorCode::BadInput,
                       message("tracker segments: a gap of ", step_s, " s before sample ", i));
      }
      if (step_s > 1.5 * tick_s) {
        cutter.lose(static_cast<std::size_t>(std::lround(step_s / tick_s)) - 1);
      }
    }
    cutter.add(samples[i]);
  }

  SegmentSeries series = cutter.take();
  series.start_tracker_m = *start;
  series.end_tracker_m = *end;
  series.samples = samples.size();
  series.first_time_s = samples.front().time_s;
  series.period_s = tick_s;

  return series;
}

Result<SegmentSeries> segments_from_means(std::span<const Vector3> means_tracker_m,
                                          const Vector3& start_tracker_m,
                                          const Vector3& end_tracker_m, const Options& options) {
  const std::size_t n = means_tracker_m.size();
  if (n < kFewestSegments) {
    return failure(ErrorCode::TooFewObservations,
                   message("tracker segments: ", n, " means, needs ", kFewestSegments));
  }

  SegmentSeries series;
  series.sub_points = options.row_points;
  series.samples = n * options.segment_samples;
  series.start_tracker_m = start_tracker_m;
  series.end_tracker_m = end_tracker_m;

  for (std::size_t i = 0; i < n; ++i) {
    const Vector3& mean = means_tracker_m[i];
    if (!mean.allFinite()) {
      return failure(ErrorCode::NotFinite,
                     message("tracker segments: mean ", i, " is not a number"));
    }
    const Vector3& before = means_tracker_m[i == 0 ? 0 : i - 1];
    const Vector3& after = means_tracker_m[i + 1 == n ? i : i + 1];
    const Vector3 travel = (after - before) / (i == 0 || i + 1 == n ? 1.0 : 2.0);
    series.segments.push_back(
        {mean, options.segment_samples, true, series.sub_points_tracker_m.size()});
    for (std::size_t k = 0; k < options.row_points; ++k) {
      const double place =
          (static_cast<double>(k) + 0.5) / static_cast<double>(options.row_points) - 0.5;
      series.sub_points_tracker_m.emplace_back(mean + place * travel);
    }
  }

  return series;
}

}  // namespace abbe::calib::otf
