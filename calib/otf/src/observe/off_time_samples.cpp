#include "observe/off_time_samples.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/statistics/root_sum_of_squares.hpp"
#include "run/robust_line.hpp"

namespace abbe::calib::otf {
namespace {

/// Variance of y_i - (y_i-1 + y_i+1) / 2 for white noise y of variance 1.
constexpr double kVarianceOffNeighbours = 1.5;

/// One valid sample of a segment or of its neighbours.
struct AlongSample {
  std::size_t index = 0;
  double time_s = 0.0;
  double along = 0.0;  ///< distance along the leg / stated standard deviation of a sample along the
                       ///< travel
};

class OffTimeSearch {
 public:
  OffTimeSearch(std::span<const TrackerObservation> samples, const SegmentSeries& series,
                const Alignment& a, const Path& path, const Noise& noise)
      : samples_(samples), series_(series), a_(a), path_(path), noise_(noise) {}

  [[nodiscard]] std::vector<std::size_t> found() const {
    const std::vector<std::size_t> segments = at_constant_speed();
    const double scale = noise_of_run(segments);
    std::vector<std::size_t> off;
    for (const std::size_t k : segments) {
      compare(k, scale, off);
    }
    return off;
  }

 private:
  [[nodiscard]] Vector3 direction(std::size_t k) const {
    return (path_.vertices_m[a_.leg[k] + 1] - path_.vertices_m[a_.leg[k]]).normalized();
  }
  [[nodiscard]] bool is_used(std::size_t k, std::size_t leg) const {
    return k < series_.segments.size() && a_.used[k] && a_.leg[k] == leg;
  }
  [[nodiscard]] bool has_neighbours(std::size_t k) const {
    return k > 0 && is_used(k - 1, a_.leg[k]) && is_used(k, a_.leg[k]) && is_used(k + 1, a_.leg[k]);
  }
  /// Mean speed along the leg from segment k to segment k + 1.
  [[nodiscard]] double speed_m_s(std::size_t k) const {
    const Segment &from = series_.segments[k], &to = series_.segments[k + 1];
    const RigidTransform& T = a_.T_machine_tracker;
    return direction(k).dot(T.R * (to.mean_tracker_m - from.mean_tracker_m)) /
           (to.time_s - from.time_s);
  }

  /// Used segments with used neighbours, if the speeds before and after are that of the leg.
  [[nodiscard]] std::vector<std::size_t> at_constant_speed() const {
    constexpr double kSame = 0.02;
    std::vector<std::size_t> all;
    const std::size_t n = series_.segments.size();
    for (std::size_t begin = 0, end = 0; begin < n; begin = end) {
      std::vector<double> speeds;
      for (end = begin; end < n && a_.leg[end] == a_.leg[begin]; ++end) {
        if (has_neighbours(end)) {
          speeds.push_back(speed_m_s(end));
        }
      }
      const double v_m_s = median(speeds);
      const auto same = [&](double speed) { return std::abs(speed - v_m_s) <= kSame * v_m_s; };
      for (std::size_t k = begin; k < end; ++k) {
        if (has_neighbours(k) && same(speed_m_s(k - 1)) && same(speed_m_s(k))) {
          all.push_back(k);
        }
      }
    }
    return all;
  }

  /// The valid samples of segment k, and of up to `more` samples before and after it.
  [[nodiscard]] std::vector<AlongSample> samples_of(std::size_t k, std::size_t more) const {
    const Segment& segment = series_.segments[k];
    const std::size_t begin = std::max(series_.segments[k - 1].begin_sample,
                                       segment.begin_sample - std::min(segment.begin_sample, more)),
                      end = std::min(series_.segments[k + 1].end_sample, segment.end_sample + more);
    const RigidTransform& T = a_.T_machine_tracker;
    const Vector3 d = direction(k), beam_m = T.R * segment.mean_tracker_m;
    const double range_m = beam_m.norm(), cosine = d.dot(beam_m) / range_m;
    const double sigma_m =
        root_sum_of_squares(noise_.sigma_range_m * cosine,
                            noise_.sigma_angle_rad * range_m * std::sqrt(1.0 - cosine * cosine));
    const Vector3 row = T.R.transpose() * d / sigma_m;

    std::vector<AlongSample> all;
    for (std::size_t i = begin; i < end; ++i) {
      if (samples_[i].valid) {
        all.push_back(
            {i, samples_[i].time_s, row.dot(samples_[i].p_tracker_m - segment.mean_tracker_m)});
      }
    }
    return all;
  }

  /// Distance of sample i from the line through the samples before and after it.
  [[nodiscard]] static double off_neighbours(const std::vector<AlongSample>& all, std::size_t i) {
    const AlongSample &before = all[i - 1], &here = all[i], &after = all[i + 1];
    const double share = (here.time_s - before.time_s) / (after.time_s - before.time_s);
    return std::abs(here.along - (1.0 - share) * before.along - share * after.along);
  }

  /// Standard deviation of a sample relative to the stated one, at least 1.
  [[nodiscard]] double noise_of_run(const std::vector<std::size_t>& segments) const {
    std::vector<double> of_segments, off;
    for (const std::size_t k : segments) {
      const std::vector<AlongSample> all = samples_of(k, 0);
      off.clear();
      for (std::size_t i = 1; i + 1 < all.size(); ++i) {
        off.push_back(off_neighbours(all, i));
      }
      if (!off.empty()) {
        of_segments.push_back(median(off));
      }
    }
    return std::max(1.0, kMadToSigma * median(of_segments) / std::sqrt(kVarianceOffNeighbours));
  }

  void compare(std::size_t k, double scale, std::vector<std::size_t>& off) const {
    constexpr double kOffTime = 5.0;
    const Segment& segment = series_.segments[k];
    const std::vector<AlongSample> all = samples_of(k, kBeside);
    for (std::size_t i = 1; i + 1 < all.size(); ++i) {
      const bool own = all[i].index >= segment.begin_sample && all[i].index < segment.end_sample;
      if (own && off_neighbours(all, i) > kOffTime * std::sqrt(kVarianceOffNeighbours) * scale &&
          is_off_line(all, i, scale)) {
        off.push_back(all[i].index);
      }
    }
  }

  [[nodiscard]] static bool is_off_line(const std::vector<AlongSample>& all, std::size_t i,
                                        double scale) {
    constexpr double kOff = 7.0;
    constexpr std::size_t kFewest = 9;
    const std::size_t begin = i - std::min(i, kBeside), end = std::min(all.size(), i + kBeside + 1);
    if (end - begin < kFewest) {
      return false;
    }
    std::vector<double> time_s, along;
    for (std::size_t k = begin; k < end; ++k) {
      time_s.push_back(all[k].time_s);
      along.push_back(all[k].along);
    }
    const RobustLine line(time_s, along);
    for (std::size_t k = 0; k < along.size(); ++k) {
      along[k] = std::abs(along[k] - line.at(time_s[k]));
    }
    const double own = along[i - begin];
    return own > kOff * std::max(scale, kMadToSigma * median(along));
  }

  static constexpr std::size_t kBeside = RobustLine::kParts / 2;

  std::span<const TrackerObservation> samples_;
  const SegmentSeries& series_;
  const Alignment& a_;
  const Path& path_;
  const Noise& noise_;
};

}  // namespace

std::vector<std::size_t> off_time_samples(std::span<const TrackerObservation> samples,
                                          const SegmentSeries& series, const Alignment& alignment,
                                          const Path& path, const Noise& noise) {
  return OffTimeSearch(samples, series, alignment, path, noise).found();
}

}  // namespace abbe::calib::otf
