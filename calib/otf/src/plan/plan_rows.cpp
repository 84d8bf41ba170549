#include "plan/plan_rows.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "abbe/calib/otf/observe/known_travel.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::otf {
namespace {

double peak_speed_m_per_s(double length_m, const Drive& drive) {
  return std::min(drive.feed_m_per_s, std::sqrt(length_m * drive.acceleration_m_per_s2));
}

/// Distance from the beginning of the leg at a time after its start.
double along_leg_m(double time_s, double length_m, const Drive& drive) {
  const double a = drive.acceleration_m_per_s2, peak = peak_speed_m_per_s(length_m, drive);
  const double ramp_s = peak / a, to_end_s = leg_duration_s(length_m, drive) - time_s;
  if (time_s < ramp_s) {
    return 0.5 * a * time_s * time_s;
  }
  if (to_end_s < ramp_s) {
    return length_m - 0.5 * a * to_end_s * to_end_s;
  }
  return peak * (time_s - 0.5 * ramp_s);
}

/// Distances of the points of the tracker on one leg.
std::vector<double> points_along_m(double length_m, const PlannedRun& run) {
  const double period_s = 1.0 / run.points_per_s;
  const double duration_s = leg_duration_s(length_m, run.drive);
  std::vector<double> along_m;
  for (double time_s = 0.5 * period_s; time_s < duration_s; time_s += period_s) {
    along_m.push_back(along_leg_m(time_s, length_m, run.drive));
  }
  return along_m;
}

double mean_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
  }
  return sum / static_cast<double>(values.size());
}

/// One leg of the run.
struct PlannedLeg {
  std::size_t number = 0;
  Vector3 from, direction;
  double length_m = 0.0;
  bool used = true;
};

void append_segment(Observations& o, const PlannedLeg& leg, std::span<const double> along_m,
                    const PlannedRun& run, std::size_t row_points) {
  const Vector3 q = leg.from + mean_of(along_m) * leg.direction;
  const std::size_t count = std::min(row_points, along_m.size());
  std::vector<Vector3> sub_points;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = (2 * k + 1) * along_m.size() / (2 * count);
    sub_points.emplace_back(leg.from + along_m[at] * leg.direction);
  }

  PointOnPath point;
  point.leg = leg.number;
  point.segment = o.segments_used++;
  point.axis_position_m = q;
  point.frame =
      path_frame(leg.direction, q + run.machine.target_offset_m - run.tracker_m, run.noise);
  point.samples = static_cast<double>(along_m.size());
  append_rows(o, point, sub_points);
}

void append_leg(Observations& o, const PlannedLeg& leg, const PlannedRun& run,
                std::size_t row_points) {
  const double corner_m = Options{}.corner_m;
  const std::size_t samples = segment_samples_for_travel(run.drive.feed_m_per_s / run.points_per_s);
  const std::vector<double> along_m = points_along_m(leg.length_m, run);
  // Segments are counted from the beginning of the run. A segment that extends over a vertex is not
  // used.
  o.samples += static_cast<std::size_t>(run.drive.dwell_s * run.points_per_s);
  const std::size_t begun = o.samples % samples;
  o.samples += along_m.size();

  for (std::size_t first = begun == 0 ? 0 : samples - begun; first + samples <= along_m.size();
       first += samples) {
    const auto segment = std::span(along_m).subspan(first, samples);
    const double centre_m = mean_of(segment);
    ++o.segments;
    if (leg.used && centre_m >= corner_m && leg.length_m - centre_m >= corner_m) {
      append_segment(o, leg, segment, run, row_points);
    }
  }
}

}  // namespace

double leg_duration_s(double length_m, const Drive& drive) {
  const double peak = peak_speed_m_per_s(length_m, drive);
  return peak > 0.0 ? length_m / peak + peak / drive.acceleration_m_per_s2 : 0.0;
}

double duration_s(const Path& path, const Drive& drive) {
  double sum_s = 0.0;
  for (std::size_t i = 1; i < path.vertices_m.size(); ++i) {
    sum_s +=
        drive.dwell_s + leg_duration_s((path.vertices_m[i] - path.vertices_m[i - 1]).norm(), drive);
  }
  return sum_s;
}

Result<Observations> planned_observations(const Path& path, const PlannedRun& run,
                                          std::size_t row_points) {
  Machine linear = run.machine;
  linear.interpolation = Interpolation::Linear;
  Result<Observations> empty = observations_without_rows(linear, path, {}, {}, run.backlash);
  if (!empty) {
    return empty;
  }

  Observations o = *std::move(empty);
  o.alignment.T_machine_tracker.t_m = run.tracker_m;
  o.u_range_offset_m = run.noise.u_range_offset_m;
  const Result<std::size_t> first = first_with_backlash(o);
  ABBE_TRY(first);
  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Vector3 leg = path.vertices_m[i + 1] - path.vertices_m[i];
    append_leg(o, {i, path.vertices_m[i], leg.normalized(), leg.norm(), i >= *first}, run,
               row_points);
  }
  return o;
}

}  // namespace abbe::calib::otf
