#include "abbe/calib/otf/observe/alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/geometry/range_change.hpp"
#include "abbe/result/try.hpp"
#include "run/path_corrections.hpp"
#include "run/progress.hpp"

namespace abbe::calib::otf {
namespace {

/// Polyline of the measured path: start, means of the segments that have samples, end.
std::vector<Vector3> measured_polyline(const SegmentSeries& series) {
  std::vector<Vector3> points{series.start_tracker_m};
  for (const Segment& b : series.segments) {
    if (b.samples > 0) {
      points.push_back(b.mean_tracker_m);
    }
  }
  points.push_back(series.end_tracker_m);
  return points;
}

Result<void> check(const SegmentSeries& series, const Path& path) {
  if (Result<void> valid = check(path); !valid) {
    return valid;
  }
  if (std::count_if(series.segments.begin(), series.segments.end(),
                    [](const Segment& b) { return b.usable; }) < 4) {
    return failure(ErrorCode::TooFewObservations, "alignment: fewer than 4 usable segments");
  }
  return {};
}

/// Rough alignment [Sanders 2023] section 1.2.3: the measured start is placed on the nominal start,
/// then rotated for the best fit of end and centroid.
Result<RigidTransform> rough(const SegmentSeries& series, const Centroid& measured,
                             const Path& path, const Centroid& nominal, const Vector3& t) {
  const Vector3& start = path.vertices_m.front();
  const Vector3 to_centre = nominal.centre_m - start, to_end = path.vertices_m.back() - start;
  const Vector3 m_centre = measured.centre_m - series.start_tracker_m;
  const Vector3 m_end = series.end_tracker_m - series.start_tracker_m;
  const Matrix3 cross = to_centre * m_centre.transpose() + to_end * m_end.transpose();
  return rotation_from_cross_covariance(cross).map([&](const Matrix3& R) {
    return RigidTransform{R, start + t - R * series.start_tracker_m};
  });
}

/// Axis positions of all segments with the transform T; NaN for segments without samples (beam
/// lost).
std::vector<Vector3> axis_positions(const SegmentSeries& series, const RigidTransform& T,
                                    const Vector3& t) {
  std::vector<Vector3> points;
  points.reserve(series.segments.size());
  for (const Segment& b : series.segments) {
    points.push_back(b.samples > 0
                         ? Vector3(T * b.mean_tracker_m - t)
                         : Vector3(Vector3::Constant(std::numeric_limits<double>::quiet_NaN())));
  }
  return points;
}

/// Pairs of measured points and closest nominal points of the used segments (usable, outside the
/// corners).
struct Pairs {
  std::vector<Vector3> measured_m, nominal_m;
  std::vector<bool> used;
  double rms_m = 0.0;
  double farthest_m = 0.0;
  std::size_t farthest_segment = 0;
};

Pairs pair_up(const SegmentSeries& series, std::span<const Vector3> points,
              std::span<const std::size_t> leg, const Path& path, const Vector3& t,
              double corner_m) {
  Pairs pairs;
  pairs.used.assign(points.size(), false);
  double squares = 0.0;

  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!series.segments[i].usable) {
      continue;
    }
    const Vector3 &from = path.vertices_m[leg[i]], &to = path.vertices_m[leg[i] + 1];
    const LegPoint closest = closest_on_leg(from, to, points[i]);
    if (closest.along_m < corner_m || (to - from).norm() - closest.along_m < corner_m) {
      continue;
    }
    pairs.used[i] = true;
    pairs.measured_m.push_back(series.segments[i].mean_tracker_m);
    pairs.nominal_m.push_back(closest.closest_m + t);
    const double distance = (points[i] - closest.closest_m).norm();
    squares += distance * distance;
    if (distance > pairs.farthest_m) {
      pairs.farthest_m = distance;
      pairs.farthest_segment = i;
    }
  }

  pairs.rms_m =
      std::sqrt(squares / static_cast<double>(std::max<std::size_t>(1, pairs.measured_m.size())));
  return pairs;
}

/// Upper bound of the travel during beam breaks. The polyline of the measured points does not
/// contain this travel, because it connects the points on both sides directly. The bound assumes
/// the mean travel of the polyline for each missing segment.
double travel_in_breaks_m(const SegmentSeries& series, double measured_m) {
  const auto has_samples = [](const Segment& b) { return b.samples > 0; };
  const auto first = std::find_if(series.segments.begin(), series.segments.end(), has_samples);
  const auto last =
      std::find_if(series.segments.rbegin(), series.segments.rend(), has_samples).base();
  const auto all = std::distance(first, last);
  const auto with_samples = std::count_if(first, last, has_samples);
  return measured_m * static_cast<double>(all - with_samples) / static_cast<double>(with_samples);
}

Result<void> check_length(double measured_m, double in_breaks_m, double nominal_m, double allowed) {
  if (measured_m > (1.0 + allowed) * nominal_m ||
      measured_m + in_breaks_m < (1.0 - allowed) * nominal_m) {
    return failure(
        ErrorCode::AlignmentFailed,
        message("alignment: the tracker measured ", measured_m, " m of travel, the path is ",
                nominal_m, " m long: another run, or an incomplete one"));
  }
  return {};
}

tl::unexpected<Error> does_not_fit(const std::string& what, double is_m, double limit_m) {
  return failure(ErrorCode::AlignmentFailed,
                 message("alignment: ", what, " is ", 1e3 * is_m, " mm, limit ", 1e3 * limit_m,
                         " mm: the points do not fit this path"));
}

Result<void> check_fit(const Alignment& a, const Pairs& pairs, const SegmentSeries& series,
                       const Path& path, const Vector3& t, const Options& options) {
  if (!(pairs.rms_m <= options.max_alignment_rms_m)) {
    return does_not_fit("rms distance to the path", pairs.rms_m, options.max_alignment_rms_m);
  }

  const double limit_m = options.max_alignment_distance_m;
  if (pairs.farthest_m > limit_m) {
    return does_not_fit(message("distance of segment ", pairs.farthest_segment, " to leg ",
                                a.leg[pairs.farthest_segment]),
                        pairs.farthest_m, limit_m);
  }

  const double start_m =
      (a.T_machine_tracker * series.start_tracker_m - t - path.vertices_m.front()).norm();
  const double end_m =
      (a.T_machine_tracker * series.end_tracker_m - t - path.vertices_m.back()).norm();

  if (start_m > limit_m) {
    return does_not_fit("distance of the first points to the first vertex", start_m, limit_m);
  }

  if (end_m > limit_m) {
    return does_not_fit("distance of the last points to the last vertex", end_m, limit_m);
  }

  return {};
}

/// Fine alignment by iterative closest points: [Sanders 2023] section 1.2.3. `pairs` receives the
/// pairs of the last iteration.
Result<void> refine(Alignment& a, Pairs& pairs, const SegmentSeries& series, const Path& path,
                    const Vector3& t, const Options& options) {
  double previous_rms_m = 0.0;
  for (int update = 0;; ++update) {
    const std::vector<Vector3> points = axis_positions(series, a.T_machine_tracker, t);
    if (update < options.leg_assignment_updates) {
      Result<std::vector<std::size_t>> leg = assign_legs(points, path, options.leg_direction_m);
      ABBE_TRY(leg);
      a.leg = *std::move(leg);
    }
    pairs = pair_up(series, points, a.leg, path, t, options.corner_m);
    a.iterations = update + 1;
    a.last_rms_m = pairs.rms_m;
    // Progress is reported relative to ten updates, the usual number.
    report(options, Stage::Align, std::min(1.0, update / 10.0));
    if (Result<void> running = check_stopped(options.stopped); !running) {
      return running;
    }
    if (update == 0) {
      a.first_rms_m = pairs.rms_m;
    }
    const double drop = (previous_rms_m - pairs.rms_m) / previous_rms_m;
    if (update >= options.min_alignment_updates && drop < options.alignment_tolerance) {
      return {};
    }
    if (update == options.max_alignment_updates) {
      return failure(ErrorCode::NotConverged, message("alignment: no convergence after ", update,
                                                      " updates, rms ", 1e6 * pairs.rms_m, " um"));
    }
    previous_rms_m = pairs.rms_m;
    const Result<RigidTransform> next = fit_rigid(pairs.measured_m, pairs.nominal_m);
    if (!next) {
      return failure(next.error().code, message("fine alignment: ", next.error().text));
    }
    a.T_machine_tracker = *next;
  }
}

Result<Alignment> align_as_given(const SegmentSeries& series, const Machine& machine,
                                 const Path& path, const Options& options) {
  ABBE_TRY(check(series, path));

  const Vector3& t = machine.target_offset_m;
  const Centroid measured = centroid(measured_polyline(series));
  const Centroid nominal = centroid(path.vertices_m);
  const Result<RigidTransform> first = rough(series, measured, path, nominal, t);

  ABBE_TRY(first);

  ABBE_TRY(check_length(measured.length_m, travel_in_breaks_m(series, measured.length_m),
                        nominal.length_m, options.max_length_mismatch));

  Alignment a;
  a.rough_T_machine_tracker = a.T_machine_tracker = *first;
  a.measured_length_m = measured.length_m;
  a.path_length_m = nominal.length_m;
  Pairs pairs;
  Result<void> valid = refine(a, pairs, series, path, t, options);

  if (valid) {
    valid = check_fit(a, pairs, series, path, t, options);
  }

  ABBE_TRY(valid);

  a.used = std::move(pairs.used);
  return a;
}

/// Returns the series with all points of the tracker replaced by `corrected(point)`.
template <class Corrected>
SegmentSeries with_points(SegmentSeries series, const Corrected& corrected) {
  for (Segment& b : series.segments) {
    b.mean_tracker_m = corrected(b.mean_tracker_m);
  }
  series.start_tracker_m = corrected(series.start_tracker_m);
  series.end_tracker_m = corrected(series.end_tracker_m);
  return series;
}

SegmentSeries with_longer_ranges(const SegmentSeries& series, double longer_m) {
  return with_points(series, [&](const Vector3& p) { return with_longer_range(p, longer_m); });
}

/// Text such as "; they fit with ranges shorter by 19.05 mm (...)"; empty if no change of the
/// ranges makes the points fit.
std::string range_change_that_fits(const SegmentSeries& series, const Machine& machine,
                                   const Path& path, const Options& options) {
  Options loose = options;
  loose.max_alignment_rms_m = loose.max_alignment_distance_m =
      std::numeric_limits<double>::infinity();
  const auto rms_m = [&](double change_m) -> std::optional<double> {
    const auto a = align_as_given(with_longer_ranges(series, change_m), machine, path, loose);
    return a ? std::optional(a->last_rms_m) : std::nullopt;
  };
  // A change of this size is a mistake. A smaller change that improves the fit only absorbs another
  // error of the run.
  constexpr double kLeastChange_m = 2e-3, kMostOfRms = 1.0 / 3.0;
  const auto change_m = best_range_change_m(rms_m);
  if (!change_m || std::abs(*change_m) < kLeastChange_m) {
    return "";
  }
  const auto before_m = rms_m(0.0), after_m = rms_m(*change_m);
  const bool fits =
      before_m && after_m && *after_m <= kMostOfRms * *before_m &&
      align_as_given(with_longer_ranges(series, *change_m), machine, path, options).has_value();
  return fits ? "; they fit with " + range_change_text(*change_m) : "";
}

}  // namespace

Result<Alignment> align(const SegmentSeries& series, const Machine& machine, const Path& path,
                        const Options& options) {
  Result<Alignment> a = align_as_given(series, machine, path, options);
  const bool stopped = options.stopped && options.stopped();
  if (!a && !stopped &&
      (a.error().code == ErrorCode::AlignmentFailed || a.error().code == ErrorCode::NotConverged)) {
    Options quiet = options;
    quiet.progress = {};
    std::string corrections = corrections_that_fit(path, machine.nodes, [&](const Path& other) {
      return !(options.stopped && options.stopped()) &&
             align_as_given(series, machine, other, quiet).has_value();
    });
    if (corrections.empty()) {
      corrections = angles_that_fit([&](const AngleMistake& mistake) {
        const SegmentSeries other = with_points(series, mistake.corrected);
        return align_as_given(other, machine, path, quiet).has_value();
      });
    }
    if (corrections.empty()) {
      corrections = range_change_that_fits(series, machine, path, quiet);
    }
    a.error().text += corrections;
  }
  return a;
}

}  // namespace abbe::calib::otf
