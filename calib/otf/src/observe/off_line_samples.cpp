#include "observe/off_line_samples.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/otf/run/path_frame.hpp"
#include "run/robust_line.hpp"

namespace abbe::calib::otf {
namespace {

constexpr std::size_t kAcross = 2;  // number of components: along a2 and a3
using Across = std::array<double, kAcross>;

/// A point relative to a leg: distance along it, and components across it in units of the stated
/// standard deviation of a sample.
struct PointAcross {
  double along_m = 0.0;
  Across across{};
};

/// Transforms the points of a segment and of its neighbours to the path frame of this segment.
class FrameOfSegment {
 public:
  FrameOfSegment(const Segment& segment, std::size_t leg, const Alignment& a, const Vector3& t,
                 const Path& path, const Noise& noise)
      : T_(a.T_machine_tracker), origin_m_(path.vertices_m[leg] + t) {
    const Vector3 d = path.vertices_m[leg + 1] - path.vertices_m[leg];
    const PathFrame frame = path_frame(d, T_.R * segment.mean_tracker_m, noise);
    axes_ << frame.a1, frame.a2 / frame.sigma2_m, frame.a3 / frame.sigma3_m;
  }

  [[nodiscard]] PointAcross point(const Vector3& p_tracker_m) const {
    const Vector3 p = axes_.transpose() * (T_ * p_tracker_m - origin_m_);
    return {p(0), {p(1), p(2)}};
  }

 private:
  const RigidTransform& T_;
  Vector3 origin_m_;
  Matrix3 axes_;  ///< columns: a1, a2 / sigma2, a3 / sigma3
};

/// Deviations of the samples of a segment and of its mean, across the travel.
struct SegmentScatter {
  Across mad{}, farthest{};  ///< median and largest absolute deviation from the segment's median
  Across off_means{};        ///< distance of its mean from the line through the means before and
                             ///< after
};

class OffLineSearch {
 public:
  OffLineSearch(std::span<const TrackerObservation> samples, const SegmentSeries& series,
                const Alignment& alignment, const Vector3& t, const Path& path, const Noise& noise)
      : samples_(samples),
        series_(series),
        alignment_(alignment),
        t_(t),
        path_(path),
        noise_(noise) {
    for (std::size_t i = 0; i < series.segments.size(); ++i) {
      if (alignment.used[i]) {
        used_.push_back(i);
      }
    }
  }

  [[nodiscard]] OffLine found() {
    scan();
    const std::vector<bool> suspicious = suspicious_segments();
    OffLine found;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      if (suspicious[k]) {
        compare_with_line(k, found);
      }
    }
    return found;
  }

 private:
  [[nodiscard]] FrameOfSegment frame(std::size_t k) const {
    return {series_.segments[used_[k]], alignment_.leg[used_[k]], alignment_, t_, path_, noise_};
  }
  [[nodiscard]] bool on_same_leg(std::size_t k, std::size_t other) const {
    return other < used_.size() && alignment_.leg[used_[k]] == alignment_.leg[used_[other]];
  }

  /// True if used segment `next` is on the leg of used segment k, with at most one unused segment
  /// between them.
  [[nodiscard]] bool follows(std::size_t k, std::size_t next) const {
    return on_same_leg(k, next) && used_[next] - used_[k] <= 2;
  }

  /// Appends the valid samples of used segment k; `index` receives their indices.
  void append(const FrameOfSegment& in, std::size_t k, std::vector<PointAcross>& points,
              std::vector<std::size_t>* index = nullptr) const {
    const Segment& segment = series_.segments[used_[k]];
    for (std::size_t i = segment.begin_sample; i < segment.end_sample; ++i) {
      if (samples_[i].valid) {
        points.push_back(in.point(samples_[i].p_tracker_m));
        if (index != nullptr) {
          index->push_back(i);
        }
      }
    }
  }

  [[nodiscard]] SegmentScatter scatter_of(std::size_t k) const {
    std::vector<PointAcross> points;
    append(frame(k), k, points);
    SegmentScatter scatter;
    std::vector<double> values;

    for (std::size_t c = 0; c < kAcross; ++c) {
      values.clear();
      for (const PointAcross& p : points) {
        values.push_back(p.across[c]);
      }
      const double middle = median(values);
      for (double& v : values) {
        v = std::abs(v - middle);
        scatter.farthest[c] = std::max(scatter.farthest[c], v);
      }
      scatter.mad[c] = median(values);
    }

    scatter.off_means = off_means(k);
    return scatter;
  }

  /// Computes the scatter of every segment, and the noise of the run (`scale_`). Segments with
  /// fewer than kEnough samples are judged by their means: the distance of a mean from its two
  /// neighbours has the variance 1.5 / n.
  void scan() {
    constexpr std::size_t kEnough = 5;
    constexpr double kOfMeans = 1.5;
    std::array<std::vector<double>, kAcross> of_segments;

    for (std::size_t k = 0; k < used_.size(); ++k) {
      scatter_.push_back(scatter_of(k));
      const std::size_t n = series_.segments[used_[k]].samples;
      for (std::size_t c = 0; c < kAcross; ++c) {
        const double by_means =
            scatter_[k].off_means[c] * std::sqrt(static_cast<double>(n) / kOfMeans);
        if (n >= kEnough || by_means > 0.0) {
          of_segments[c].push_back(kMadToSigma * (n >= kEnough ? scatter_[k].mad[c] : by_means));
        }
      }
    }

    for (std::size_t c = 0; c < kAcross; ++c) {
      scale_[c] = std::max(1.0, median(of_segments[c]));
    }
  }

  /// Distance of the mean of segment k from the line through the means before and after.
  [[nodiscard]] Across off_means(std::size_t k) const {
    if (k == 0 || !follows(k - 1, k) || !follows(k, k + 1)) {
      return {};
    }
    const FrameOfSegment in = frame(k);
    const auto mean = [&](std::size_t i) {
      return in.point(series_.segments[used_[i]].mean_tracker_m);
    };
    const PointAcross before = mean(k - 1), here = mean(k), after = mean(k + 1);
    const double span_m = after.along_m - before.along_m;
    const double share = span_m > 0.0 ? (here.along_m - before.along_m) / span_m : 0.5;
    Across off{};
    for (std::size_t c = 0; c < kAcross; ++c) {
      off[c] =
          std::abs(here.across[c] - (1.0 - share) * before.across[c] - share * after.across[c]);
    }
    return off;
  }

  /// For each used segment: true if it must be compared with a line.
  [[nodiscard]] std::vector<bool> suspicious_segments() const {
    constexpr double kOffLine = 5.0;
    std::vector<bool> all(used_.size(), false);
    for (std::size_t k = 0; k < used_.size(); ++k) {
      bool suspicious = false;
      for (std::size_t c = 0; c < kAcross; ++c) {
        const double limit = kOffLine * scale_[c];
        suspicious =
            suspicious || scatter_[k].farthest[c] > limit || scatter_[k].off_means[c] > limit;
      }
      for (std::size_t i = k == 0 ? 0 : k - 1; suspicious && i <= k + 1; ++i) {
        if (on_same_leg(k, i)) {
          all[i] = true;
        }
      }
    }
    return all;
  }

  /// Range [begin, end) of used segments on the leg around k: five, or more (at most nine) until
  /// they have enough samples for a line.
  [[nodiscard]] std::pair<std::size_t, std::size_t> window(std::size_t k) const {
    constexpr std::size_t kSegments = 5, kMostSegments = 9;
    std::size_t begin = k, end = k + 1, count = series_.segments[used_[k]].samples;
    while (end - begin < kSegments || (end - begin < kMostSegments && count < RobustLine::kParts)) {
      const bool can_begin = begin > 0 && follows(begin - 1, begin),
                 can_end = follows(end - 1, end);
      if (!can_begin && !can_end) {
        break;
      }
      const bool grow_begin = can_begin && (!can_end || k - begin < end - k);
      count += series_.segments[used_[grow_begin ? --begin : end++]].samples;
    }
    return {begin, end};
  }

  void compare_with_line(std::size_t k, OffLine& found) const {
    constexpr std::size_t kFewest = 9;
    const FrameOfSegment in = frame(k);
    const auto [begin, end] = window(k);
    std::vector<PointAcross> around, own;
    std::vector<std::size_t> index;
    for (std::size_t i = begin; i < end; ++i) {
      append(in, i, around);
    }
    if (around.size() < kFewest) {
      return;
    }

    append(in, k, own, &index);
    std::vector<bool> off(own.size(), false);
    double noise_factor = 1.0;
    for (std::size_t c = 0; c < kAcross; ++c) {
      compare_component(around, own, c, off);
      noise_factor = std::max(noise_factor, noise_of_differences(own, c) / scale_[c]);
    }

    for (std::size_t i = 0; i < own.size(); ++i) {
      if (off[i]) {
        found.samples.push_back(index[i]);
      }
    }
    constexpr double kNoisy = 3.0;
    if (noise_factor > kNoisy) {
      found.segments.push_back({used_[k], noise_factor});
    }
  }

  void compare_component(std::span<const PointAcross> around, std::span<const PointAcross> own,
                         std::size_t c, std::vector<bool>& off) const {
    constexpr double kOff = 7.0;
    std::vector<double> along_m, across;
    for (const PointAcross& p : around) {
      along_m.push_back(p.along_m);
      across.push_back(p.across[c]);
    }
    const RobustLine line(along_m, across);
    for (std::size_t i = 0; i < across.size(); ++i) {
      across[i] = std::abs(across[i] - line.at(along_m[i]));
    }
    const double limit = kOff * std::max(scale_[c], kMadToSigma * median(across));
    for (std::size_t i = 0; i < own.size(); ++i) {
      off[i] = off[i] || std::abs(own[i].across[c] - line.at(own[i].along_m)) > limit;
    }
  }

  /// Standard deviation of a sample, from the differences of successive samples.
  [[nodiscard]] static double noise_of_differences(std::span<const PointAcross> points,
                                                   std::size_t c) {
    constexpr std::size_t kEnough = 9;
    std::vector<double> differences;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      differences.push_back(std::abs(points[i + 1].across[c] - points[i].across[c]));
    }
    return differences.size() < kEnough ? 0.0 : kMadToSigma * median(differences) / std::sqrt(2.0);
  }

  std::span<const TrackerObservation> samples_;
  const SegmentSeries& series_;
  const Alignment& alignment_;
  const Vector3& t_;
  const Path& path_;
  const Noise& noise_;
  std::vector<std::size_t> used_;  ///< indices of the used segments
  std::vector<SegmentScatter> scatter_;
  Across scale_{};
};

}  // namespace

OffLine off_line_samples(std::span<const TrackerObservation> samples, const SegmentSeries& series,
                         const Alignment& alignment, const Vector3& target_offset_m,
                         const Path& path, const Noise& noise) {
  return OffLineSearch(samples, series, alignment, target_offset_m, path, noise).found();
}

}  // namespace abbe::calib::otf
