#include "abbe/calib/internal/otf/observe/along_rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

/// Speed of a segment along its leg.
struct SegmentSpeed {
  double v_m_s = 0.0;
  double u_m_s = 0.0;
};

/// Decides which segments were measured at constant speed. Condition: the segment and both
/// neighbours on its leg have the median speed of the leg, within 2 % and four standard
/// uncertainties. During acceleration, following errors and the delay of the tracker change.
class ConstantSpeed {
 public:
  ConstantSpeed(const Observations& o, std::span<const std::optional<EncoderLine>> lines,
                double sigma_time_s)
      : constant_(lines.size(), false) {
    const std::vector<std::size_t>& leg = o.alignment.leg;
    for (std::size_t begin = 0, end = 0; begin < lines.size(); begin = end) {
      while (end < lines.size() && leg[end] == leg[begin]) {
        ++end;
      }
      const Vector3 d = (o.vertices_m[leg[begin] + 1] - o.vertices_m[leg[begin]]).normalized();
      take_leg(lines, begin, end, d, sigma_time_s);
    }
    leg_ = leg;
  }

  [[nodiscard]] bool holds(std::size_t segment) const {
    const auto is_constant = [&](std::size_t i) {
      return i < constant_.size() && leg_[i] == leg_[segment] && constant_[i];
    };
    return segment > 0 && is_constant(segment - 1) && is_constant(segment) &&
           is_constant(segment + 1);
  }

 private:
  void take_leg(std::span<const std::optional<EncoderLine>> lines, std::size_t begin,
                std::size_t end, const Vector3& d, double sigma_time_s) {
    std::vector<double> speeds;
    for (std::size_t i = begin; i < end; ++i) {
      if (lines[i]) {
        speeds.push_back(lines[i]->v_m_s.dot(d));
      }
    }
    if (speeds.empty()) {
      return;
    }

    const double v_m_s = median(speeds);
    constexpr double kStands_m_s = 1e-4, kSame = 0.02, kSure = 4.0;
    for (std::size_t i = begin; v_m_s > kStands_m_s && i < end; ++i) {
      if (lines[i]) {
        const double u_m_s = v_m_s * sigma_time_s * std::sqrt(lines[i]->variance_of_v);
        constant_[i] =
            std::abs(lines[i]->v_m_s.dot(d) - v_m_s) <= std::max(kSame * v_m_s, kSure * u_m_s);
      }
    }
  }

  std::vector<bool> constant_;
  std::vector<std::size_t> leg_;
};

/// Variance of one sample along a unit vector.
double sample_variance_m2(const Vector3& direction, const Vector3& beam_m, const Noise& noise) {
  const double range_m = beam_m.norm(), cosine = direction.dot(beam_m) / range_m;
  const double across_m = noise.sigma_angle_rad * range_m;
  return noise.sigma_range_m * noise.sigma_range_m * cosine * cosine +
         across_m * across_m * (1.0 - cosine * cosine);
}

/// Lines through the readings at the time of every usable segment.
std::vector<std::optional<EncoderLine>> lines_of_segments(const EncoderLines& lines,
                                                          const SegmentSeries& series,
                                                          const RunClock& clock) {
  std::vector<std::optional<EncoderLine>> all(series.segments.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Segment& b = series.segments[i];
    if (b.usable) {
      all[i] = lines.line(clock.since_start_s(b.first_s - 0.5 * series.period_s),
                          clock.since_start_s(b.time_s),
                          clock.since_start_s(b.last_s + 0.5 * series.period_s));
    }
  }
  return all;
}

/// Copies the rows of `across` from `begin` to `end`.
void append_copies(Observations& to, const Observations& across, std::size_t begin,
                   std::size_t end) {
  for (std::size_t i = begin; i < end; ++i) {
    to.A.append(across.A.row(i));
    to.rows.push_back(across.rows[i]);
  }
}

}  // namespace

AlongRows::AlongRows(const EncoderLog& log, const RunClock& clock)
    : log_(&log), lines_(log.readings), clock_(clock) {}

void AlongRows::correct_clock(const Eigen::VectorXd& by) {
  if (by.size() == static_cast<Eigen::Index>(kClockUnknowns)) {
    clock_.lag_s += by(0);
    clock_.drift += by(1);
  }
}

void AlongRows::leave_out(std::span<const std::size_t> segments) {
  left_out_.insert(left_out_.end(), segments.begin(), segments.end());
  std::sort(left_out_.begin(), left_out_.end());
}

Observations AlongRows::added_to(const Observations& across, const SegmentSeries& series,
                                 const Noise& noise) const {
  const auto lines = lines_of_segments(lines_, series, clock_);
  const ConstantSpeed constant(across, lines, log_->sigma_time_s);
  Observations o = across;
  o.A = {};
  o.rows.clear();
  o.clock_unknowns = clock_unknowns();

  for (std::size_t i = 0; i < across.rows.size(); i += 2) {
    append_copies(o, across, i, i + 2);
    const Observation &row = across.rows[i], &other = across.rows[i + 1];
    if (!constant.holds(row.segment) ||
        std::binary_search(left_out_.begin(), left_out_.end(), row.segment)) {
      continue;
    }

    const Segment& segment = series.segments[row.segment];
    const EncoderLine& line = *lines[row.segment];
    const RigidTransform& T = across.alignment.T_machine_tracker;
    const Vector3 a1 = row.direction.cross(other.direction);  // a1 = a2 x a3
    const double v_m_s = a1.dot(line.v_m_s), late_m = v_m_s * log_->sigma_time_s;
    const double variance_m2 =
        sample_variance_m2(a1, T.R * segment.mean_tracker_m, noise) / segment.effective_samples() +
        late_m * late_m * line.variance;
    const std::array<SparseRows::Entry, kClockUnknowns> clock{
        {{o.clock_offset(), v_m_s},
         {o.clock_offset() + 1, v_m_s * (segment.time_s - clock_.origin_s)}}};

    const std::vector<Vector3> sub_points_m(
        across.sub_points_m.begin() + static_cast<std::ptrdiff_t>(row.first_sub_point),
        across.sub_points_m.begin() +
            static_cast<std::ptrdiff_t>(row.first_sub_point + row.sub_points));
    const Vector3 deviation_m = T * segment.mean_tracker_m - across.target_offset_m - line.q_m;
    const MeasuredComponent along{a1, sigma_factor_ * std::sqrt(variance_m2),
                                  std::span(clock).first(o.clock_unknowns)};
    append_rows(o, {row.leg, row.segment, deviation_m, row.axis_position_m, {}, 1.0}, sub_points_m,
                std::span(&along, 1));
    o.rows.back().component = kAlong;
  }

  return o;
}

}  // namespace abbe::calib::otf
