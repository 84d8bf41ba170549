#include "observe/clock_match.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

/// A used segment: position and direction of travel, with the time of the tracker's clock.
struct TimedPoint {
  double time_s = 0.0;
  Vector3 q_m = Vector3::Zero();
  Vector3 direction = Vector3::UnitX();
};

/// Larger distances count as this value. At the correct offset of the clocks the distances are
/// below 1 mm, at a wrong offset they are centimetres.
constexpr double kFar_m = 0.02;
constexpr double kTravelPerStep_m = 2e-3;  ///< travel between two offsets that are compared
/// Limits of the median and of the 95 % quantile of the distances between points and readings. The
/// gate accepts errors up to 1 mm.
constexpr double kMedianLimit_m = 1e-3, kLimit_m = 3e-3;
constexpr double kLeastCovered = 0.25;  ///< share of the used segments whose time the log contains

std::vector<TimedPoint> timed_points(const Observations& across, const SegmentSeries& series) {
  std::vector<TimedPoint> points;
  const RigidTransform& T = across.alignment.T_machine_tracker;
  for (std::size_t i = 0; i < series.segments.size(); ++i) {
    if (across.alignment.used[i]) {
      const std::size_t leg = across.alignment.leg[i];
      points.push_back({series.segments[i].time_s,
                        T * series.segments[i].mean_tracker_m - across.target_offset_m,
                        (across.vertices_m[leg + 1] - across.vertices_m[leg]).normalized()});
    }
  }
  return points;
}

double median_speed_m_s(std::span<const TimedPoint> points) {
  std::vector<double> speeds;
  for (std::size_t i = 1; i < points.size(); ++i) {
    speeds.push_back((points[i].q_m - points[i - 1].q_m).norm() /
                     (points[i].time_s - points[i - 1].time_s));
  }
  return median(speeds);
}

/// The readings interpolated at equal steps of time; steps in gaps have no value.
class SteppedLog {
 public:
  SteppedLog(const EncoderLines& lines, double wanted_step_s) {
    constexpr double kMostSteps = 1e6;  // they take 24 MB
    const std::span<const EncoderReading> readings = lines.readings();
    const double span_s = readings.back().time_s;
    step_s_ = std::max(wanted_step_s, span_s / kMostSteps);
    const auto steps = static_cast<std::size_t>(std::floor(span_s / step_s_)) + 1;
    q_m_.reserve(steps);
    for (std::size_t i = 0; i < steps; ++i) {
      const double at_s = static_cast<double>(i) * step_s_;
      const std::optional<EncoderLine> line = lines.line(at_s, at_s, at_s);
      q_m_.push_back(line ? line->q_m
                          : Vector3::Constant(std::numeric_limits<double>::quiet_NaN()));
    }
  }

  /// Time of the log that belongs to the first point. It is the time with the smallest sum of
  /// squared distances, each limited to kFar_m.
  [[nodiscard]] double best_start_s(std::span<const TimedPoint> points) const {
    std::vector<std::ptrdiff_t> step_of;
    const double start_s = points.front().time_s;
    for (const TimedPoint& p : points) {
      step_of.push_back(std::lround((p.time_s - start_s) / step_s_));
    }

    double least = std::numeric_limits<double>::infinity();
    std::ptrdiff_t best = 0;
    for (std::ptrdiff_t shift = -step_of.back(); shift < std::ssize(q_m_); ++shift) {
      const double sum = squares_m2(points, step_of, shift, least);
      if (sum < least) {
        least = sum;
        best = shift;
      }
    }
    return static_cast<double>(best) * step_s_;
  }

 private:
  /// Sum of squared distances for a shift of the log. The computation stops when the sum exceeds
  /// `least`.
  [[nodiscard]] double squares_m2(std::span<const TimedPoint> points,
                                  std::span<const std::ptrdiff_t> step_of, std::ptrdiff_t shift,
                                  double least) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < points.size() && sum < least; ++i) {
      const std::ptrdiff_t at = step_of[i] + shift;
      double square = kFar_m * kFar_m;
      if (at >= 0 && at < std::ssize(q_m_)) {
        const double found = (points[i].q_m - q_m_[static_cast<std::size_t>(at)]).squaredNorm();
        square = found < square ? found : square;  // steps in gaps (NaN) count as kFar_m
      }
      sum += square;
    }
    return sum;
  }

  double step_s_ = 0.0;
  std::vector<Vector3> q_m_;
};

/// Comparison of a point with the readings for a given clock; made only for points whose time the
/// log contains.
struct PointToLog {
  double time_s = 0.0;
  double distance_m = 0.0;
  double late_s = 0.0;  ///< correction of the offset that follows from this point
};
std::vector<PointToLog> compared(std::span<const TimedPoint> points, const EncoderLines& lines,
                                 const RunClock& clock) {
  std::vector<PointToLog> all;
  for (const TimedPoint& p : points) {
    const double at_s = clock.since_start_s(p.time_s);
    if (const std::optional<EncoderLine> line = lines.line(at_s, at_s, at_s)) {
      const Vector3 difference = p.q_m - line->q_m;
      const double v_m_s = p.direction.dot(line->v_m_s);
      all.push_back(
          {p.time_s, difference.norm(), v_m_s > 1e-4 ? p.direction.dot(difference) / v_m_s : 0.0});
    }
  }
  return all;
}

/// Corrects the clock by the medians of the corrections from the first and the last half of the
/// points. Only points near the readings are used.
void correct(RunClock& clock, std::span<const PointToLog> all) {
  std::vector<PointToLog> near;
  std::copy_if(all.begin(), all.end(), std::back_inserter(near),
               [](const PointToLog& p) { return p.distance_m < kFar_m; });
  constexpr std::size_t kFew = 8;
  if (near.size() < kFew) {
    return;
  }

  const auto median_of = [&](std::size_t begin, std::size_t end, double PointToLog::*member) {
    std::vector<double> values;
    for (std::size_t i = begin; i < end; ++i) {
      values.push_back(near[i].*member);
    }
    return median(values);
  };
  const std::size_t half = near.size() / 2;
  const double t1_s = median_of(0, half, &PointToLog::time_s),
               t2_s = median_of(half, near.size(), &PointToLog::time_s);
  const double late1_s = median_of(0, half, &PointToLog::late_s),
               late2_s = median_of(half, near.size(), &PointToLog::late_s);
  const double drift = (late2_s - late1_s) / (t2_s - t1_s);
  clock.drift += drift;
  clock.lag_s += late1_s - drift * (t1_s - clock.origin_s);
}

/// Distances of the readings from the points with the best clock.
struct ClockFit {
  RunClock clock;
  double median_m = std::numeric_limits<double>::infinity();
  double share_95_m = std::numeric_limits<double>::infinity();
  double covered = 0.0;

  [[nodiscard]] bool is_good() const {
    return median_m <= kMedianLimit_m && share_95_m <= kLimit_m && covered >= kLeastCovered;
  }
};

ClockFit fit_at(const RunClock& clock, std::span<const TimedPoint> points,
                const EncoderLines& lines) {
  ClockFit fit{.clock = clock};
  std::vector<double> distances;
  for (const PointToLog& p : compared(points, lines, clock)) {
    distances.push_back(p.distance_m);
  }
  if (distances.empty()) {
    return fit;
  }

  fit.covered = static_cast<double>(distances.size()) / static_cast<double>(points.size());
  const auto at_95 = distances.begin() + (95 * std::ssize(distances)) / 100;
  std::nth_element(distances.begin(), at_95, distances.end());
  fit.share_95_m = *at_95;
  fit.median_m = median(distances);
  return fit;
}

ClockFit best_fit(std::span<const TimedPoint> points, const EncoderLines& lines, double origin_s) {
  constexpr std::size_t kCompared = 400;  // points; more than enough for an offset to 10 ms
  std::vector<TimedPoint> few;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kCompared);
  for (std::size_t i = 0; i < points.size(); i += stride) {
    few.push_back(points[i]);
  }

  const double step_s = kTravelPerStep_m / std::max(1e-4, median_speed_m_s(points));
  RunClock clock{
      .lag_s = SteppedLog(lines, step_s).best_start_s(few) - (few.front().time_s - origin_s),
      .origin_s = origin_s,
      .log_start_s = lines.log_start_s()};
  constexpr int kCorrections = 4;  // each leaves a tenth of the error, until machine errors
                                   // dominate
  for (int i = 0; i < kCorrections; ++i) {
    correct(clock, compared(points, lines, clock));
  }
  return fit_at(clock, points, lines);
}

/// Names the mistakes in the readings whose correction makes the readings fit.
std::string mistakes_that_fit(std::span<const TimedPoint> points, const EncoderLog& log,
                              double origin_s) {
  std::vector<std::string> texts;
  const auto try_with = [&](const Matrix3& M, const std::string& text) {
    std::vector<EncoderReading> readings = log.readings;
    for (EncoderReading& r : readings) {
      r.q_m = M * r.q_m;
    }
    if (best_fit(points, EncoderLines(readings), origin_s).is_good()) {
      texts.push_back(text);
    }
  };

  for (const AxisMistake& mistake : axis_mistakes()) {
    try_with(mistake.M, mistake.text);
  }
  for (const UnitMistake& mistake : unit_mistakes()) {
    try_with(mistake.factor * Matrix3::Identity(), mistake.text);
  }
  return texts.empty() ? "; they are of another run, or incomplete"
                       : "; they fit with " + or_list(texts);
}

}  // namespace

Result<RunClock> match_clocks(const EncoderLog& log, const Observations& across,
                              const SegmentSeries& series) {
  const std::vector<TimedPoint> points = timed_points(across, series);
  const EncoderLines lines(log.readings);
  const double origin_s = series.first_time_s;
  const ClockFit fit =
      log.known_clock
          ? fit_at(RunClock::of(*log.known_clock, origin_s, lines.log_start_s()), points, lines)
          : best_fit(points, lines, origin_s);
  if (fit.is_good()) {
    return fit.clock;
  }

  if (fit.median_m <= kMedianLimit_m && fit.share_95_m <= kLimit_m) {
    return failure(ErrorCode::AlignmentFailed,
                   message("scale readings: they contain the times of ", 100.0 * fit.covered,
                           " % of the segments only, needs ", 100.0 * kLeastCovered, " %"));
  }

  const std::string where =
      log.known_clock ? "with the stated clock" : "at the best offset of the clocks";
  const std::string how = std::isfinite(fit.median_m)
                              ? message("are ", 1e3 * fit.median_m, " mm (median) and ",
                                        1e3 * fit.share_95_m, " mm (95 %)")
                              : std::string("are at no time of the run");
  return failure(
      ErrorCode::AlignmentFailed,
      message("scale readings: ", where, " they ", how, " from the tracker's points, limits ",
              1e3 * kMedianLimit_m, " and ", 1e3 * kLimit_m, " mm",
              log.known_clock ? "" : mistakes_that_fit(points, log, origin_s)));
}

}  // namespace abbe::calib::otf
