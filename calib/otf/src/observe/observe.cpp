#include "abbe/calib/otf/observe/observe.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/calib/internal/base/check_stopped.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/statistics/median.hpp"
#include "abbe/calib/otf/observe/known_travel.hpp"
#include "abbe/result/try.hpp"
#include "observe/observe_aligned.hpp"
#include "observe/rigid_columns.hpp"
#include "observe/run_times.hpp"
#include "run/progress.hpp"

namespace abbe::calib::otf {
namespace {

/// Columns of M B averaged over positions, sorted by parameter index.
class MeanColumns {
 public:
  void add(std::span<const Column> columns) {
    if (++count_ == 1) {
      sum_.assign(columns.begin(), columns.end());
      return;
    }

    auto at = sum_.begin();
    for (const Column& c : columns) {
      at = std::lower_bound(
          at, sum_.end(), c.parameter,
          [](const Column& s, std::size_t parameter) { return s.parameter < parameter; });
      if (at == sum_.end() || at->parameter != c.parameter) {
        at = sum_.insert(at, Column{c.parameter, Vector3::Zero()});
      }
      at->dV_dU += c.dV_dU;
    }
  }

  [[nodiscard]] std::vector<SparseRows::Entry> along(const Vector3& direction) const {
    std::vector<SparseRows::Entry> row;
    row.reserve(sum_.size());
    for (const Column& c : sum_) {
      row.push_back({c.parameter, direction.dot(c.dV_dU) / static_cast<double>(count_)});
    }
    return row;
  }

 private:
  std::vector<Column> sum_;
  std::size_t count_ = 0;
};

MeanColumns mean_columns(const Observations& o, std::size_t leg,
                         std::span<const Vector3> sub_points_m) {
  std::vector<Column> memory(o.basis.most_columns() + kRigidUnknowns);
  ModelColumns columns(memory);
  MeanColumns mean;
  for (const Vector3& q : sub_points_m) {
    columns.clear();
    o.basis.append_columns(o.state_on(leg, q), columns);
    append_rigid_columns(columns, o.rigid_offset(), q + o.target_offset_m);
    mean.add(columns.span());
  }
  return mean;
}

/// Median travel from one usable segment to the next; 0 without two such segments.
double travel_per_segment_m(const SegmentSeries& series) {
  std::vector<double> travel_m;
  for (std::size_t i = 0; i + 1 < series.segments.size(); ++i) {
    if (series.segments[i].usable && series.segments[i + 1].usable) {
      travel_m.push_back(
          (series.segments[i + 1].mean_tracker_m - series.segments[i].mean_tracker_m).norm());
    }
  }

  return median(travel_m);
}

}  // namespace

Result<void> check_travel(const SegmentSeries& series, const Options& options) {
  const double travel_m = travel_per_segment_m(series), most_m = 2.0 * options.corner_m;
  if (travel_m <= most_m) {
    return {};
  }

  const double too_far = travel_m / most_m;
  const double most_samples = std::floor(static_cast<double>(options.segment_samples) / too_far);
  if (most_samples >= 1.0) {
    return failure(ErrorCode::BadInput,
                   message("tracker segments: ", options.segment_samples, " samples travel ",
                           1e3 * travel_m, " mm, limit ", 1e3 * most_m, " mm: use at most ",
                           most_samples, " samples per segment"));
  }

  const double between_m = travel_m / static_cast<double>(options.segment_samples);
  const double more_points = std::ceil(10.0 * between_m / most_m) / 10.0;
  return failure(ErrorCode::BadInput,
                 message("tracker: the points are ", 1e3 * between_m, " mm apart, limit ",
                         1e3 * most_m, " mm: drive slower, or measure with at least ", more_points,
                         " times as many points per second"));
}

namespace {

PointOnPath point_on_path(const Segment& segment, std::size_t i, const Alignment& a,
                          const Path& path, const Vector3& t, const Noise& noise) {
  const Vector3 &from = path.vertices_m[a.leg[i]], &to = path.vertices_m[a.leg[i] + 1];
  const Vector3 q = a.T_machine_tracker * segment.mean_tracker_m - t;
  const Vector3 closest = closest_on_leg(from, to, q).closest_m;
  // Measured points are relative to the tracker, so that rotating them to machine coordinates gives
  // the vector of the beam.
  const Vector3 beam_m = a.T_machine_tracker.R * segment.mean_tracker_m;
  return {a.leg[i],
          i,
          q - closest,
          closest,
          path_frame(to - from, beam_m, noise),
          segment.effective_samples()};
}

std::vector<Vector3> sub_points(const SegmentSeries& series, std::size_t i, const Alignment& a,
                                const Path& path, const Vector3& t) {
  const Vector3 &from = path.vertices_m[a.leg[i]], &to = path.vertices_m[a.leg[i] + 1];
  std::vector<Vector3> points;
  points.reserve(series.sub_points);
  for (std::size_t k = 0; k < series.sub_points; ++k) {
    const Vector3& p = series.sub_points_tracker_m[series.segments[i].first_sub_point + k];
    points.push_back(closest_on_leg(from, to, a.T_machine_tracker * p - t).closest_m);
  }
  return points;
}

/// First and last measured position of every leg, for the validity volume. A vertex counts as
/// covered if such a position is within three times `corner_m` of it: the model then extrapolates
/// to the vertex by less than the distance of two nodes.
std::vector<Vector3> covered(const Observations& o, const Path& path, double corner_m) {
  std::vector<Vector3> points;
  for (std::size_t i = 0; i < o.rows.size();) {
    std::size_t last = i;
    while (last + 1 < o.rows.size() && o.rows[last + 1].leg == o.rows[i].leg) {
      ++last;
    }
    const Vector3 &from = path.vertices_m[o.rows[i].leg], &to = path.vertices_m[o.rows[i].leg + 1];
    const Vector3 &first_point = o.rows[i].axis_position_m,
                  &last_point = o.rows[last].axis_position_m;
    points.push_back((first_point - from).norm() <= 3 * corner_m ? from : first_point);
    points.push_back((last_point - to).norm() <= 3 * corner_m ? to : last_point);
    i = last + 1;
  }

  return points;
}

}  // namespace

void SparseRows::append(std::span<const Entry> row) {
  entries_.insert(entries_.end(), row.begin(), row.end());
  begin_.push_back(entries_.size());
}

std::span<const SparseRows::Entry> SparseRows::row(std::size_t i) const {
  return std::span(entries_).subspan(begin_[i], begin_[i + 1] - begin_[i]);
}

MachineState Observations::state_on(std::size_t leg, const Vector3& q_m) const {
  return {.q_m = q_m,
          .tool_offset_m = target_offset_m,
          .travel = leg < travel.size() ? travel[leg] : AxisTravel{}};
}

std::string Observations::label(std::size_t unknown) const {
  constexpr std::array<std::string_view, kRigidUnknowns + kClockUnknowns> kNames{
      "tx", "ty", "tz", "rx", "ry", "rz", "offset of the clocks", "drift of the clocks"};
  return unknown < rigid_offset() ? basis.label(unknown)
                                  : std::string(kNames.at(unknown - rigid_offset()));
}

Result<void> check(const Noise& noise) {
  if (!(noise.sigma_range_m > 0) || !(noise.sigma_angle_rad > 0) ||
      !std::isfinite(noise.sigma_range_m) || !std::isfinite(noise.sigma_angle_rad)) {
    return failure(ErrorCode::BadInput,
                   message("tracker noise: sigma_range ", noise.sigma_range_m, " m, sigma_angle ",
                           noise.sigma_angle_rad, " rad: both must be positive"));
  }

  if (!(noise.u_scale >= 0) || !std::isfinite(noise.u_scale)) {
    return failure(ErrorCode::BadInput,
                   message("tracker noise: u_scale ", noise.u_scale, ": must not be negative"));
  }

  if (!(noise.u_range_offset_m >= 0) || !std::isfinite(noise.u_range_offset_m)) {
    return failure(ErrorCode::BadInput,
                   message("tracker noise: u_range_offset ", noise.u_range_offset_m,
                           " m: must not be negative"));
  }

  for (const double u : noise.u_axis_scale) {
    if (!(u >= 0) || !std::isfinite(u)) {
      return failure(ErrorCode::BadInput,
                     message("scales: relative uncertainty ", u, ": must not be negative"));
    }
  }

  return {};
}

void append_rows(Observations& o, const PointOnPath& point, std::span<const Vector3> sub_points_m,
                 std::span<const MeasuredComponent> components) {
  const MeanColumns columns = mean_columns(o, point.leg, sub_points_m);
  const std::size_t first = o.sub_points_m.size();
  o.sub_points_m.insert(o.sub_points_m.end(), sub_points_m.begin(), sub_points_m.end());
  std::size_t component = 0;
  for (const MeasuredComponent& c : components) {
    std::vector<SparseRows::Entry> row = columns.along(c.direction);
    row.insert(row.end(), c.clock.begin(), c.clock.end());
    o.A.append(row);
    o.rows.push_back({c.direction.dot(point.deviation_m), c.sigma_m, 1.0 / (c.sigma_m * c.sigma_m),
                      point.leg, point.segment, c.direction, point.axis_position_m, first,
                      sub_points_m.size(), component++});
  }
}

void append_rows(Observations& o, const PointOnPath& point, std::span<const Vector3> sub_points_m) {
  const double root = std::sqrt(point.samples);
  const PathFrame& frame = point.frame;
  append_rows(o, point, sub_points_m,
              std::array{MeasuredComponent{frame.a2, frame.sigma2_m / root},
                         MeasuredComponent{frame.a3, frame.sigma3_m / root}});
}

Result<Observations> observations_without_rows(const Machine& machine, const Path& path,
                                               const Noise& noise, Alignment alignment,
                                               TravelDependence backlash) {
  auto tables = TableOptions::all_axes(machine.interpolation);
  tables.travel = backlash;
  Result<TableBasis> basis =
      ParameterLayout::observable_with_one_target(machine.chain, machine.nodes)
          .and_then(
              [&](ParameterLayout layout) { return TableBasis::of(std::move(layout), tables); });
  ABBE_TRY(basis);

  return Observations{.basis = *std::move(basis),
                      .target_offset_m = machine.target_offset_m,
                      .alignment = std::move(alignment),
                      .vertices_m = path.vertices_m,
                      .travel = travel_along(path.vertices_m, Mode::OnTheFly),
                      .u_scale = noise.u_scale,
                      .u_axis_scale = noise.u_axis_scale,
                      .u_range_offset_m = noise.u_range_offset_m};
}

double drow_drange_offset(const Observations& o, const Observation& row) {
  const Vector3 beam_m =
      row.axis_position_m + o.target_offset_m - o.alignment.T_machine_tracker.t_m;
  return row.direction.dot(beam_m.normalized());
}

Observations without_range_offset(Observations o, double range_offset_m) {
  if (range_offset_m != 0.0) {
    for (Observation& row : o.rows) {
      row.y_m -= range_offset_m * drow_drange_offset(o, row);
    }
  }
  return o;
}

Observations with_basis(const Observations& o, TableBasis basis) {
  Observations other = o;
  other.basis = std::move(basis);
  other.A = {};
  MeanColumns columns;

  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    // The rows of a segment have the same sub-points and the same columns.
    if (i == 0 || row.first_sub_point != o.rows[i - 1].first_sub_point) {
      columns = mean_columns(
          other, row.leg, std::span(o.sub_points_m).subspan(row.first_sub_point, row.sub_points));
    }
    std::vector<SparseRows::Entry> entries = columns.along(row.direction);
    for (const SparseRows::Entry& e : o.A.row(i)) {
      if (e.column >= o.clock_offset()) {
        entries.push_back({e.column - o.clock_offset() + other.clock_offset(), e.value});
      }
    }
    other.A.append(entries);
  }

  return other;
}

Result<Observations> observe_segments(const SegmentSeries& series, const Machine& machine,
                                      const Path& path, const Noise& noise,
                                      const Options& options) {
  Result<void> valid = check(noise);
  if (valid) {
    valid = check_travel(series, options);
  }
  ABBE_TRY(valid);

  return align(series, machine, path, options).and_then([&](Alignment alignment) {
    return observe_aligned(series, std::move(alignment), machine, path, noise, options);
  });
}

Result<Observations> observe_aligned(const SegmentSeries& series, Alignment alignment,
                                     const Machine& machine, const Path& path, const Noise& noise,
                                     const Options& options) {
  Result<Observations> empty =
      observations_without_rows(machine, path, noise, std::move(alignment), options.backlash);
  if (!empty) {
    return empty;
  }

  Observations o = *std::move(empty);
  const Result<std::size_t> first_leg = first_with_backlash(o);
  ABBE_TRY(first_leg);
  o.samples = series.samples;
  o.lost_samples = series.lost_samples;
  o.segments = series.segments.size();
  if (series.period_s > 0.0) {
    o.segment_s = times_of(series).of_segment_s;
  }
  o.beam_returned = series.beam_returned;
  o.set_aside = series.set_aside;

  for (std::size_t i = 0; i < series.segments.size(); ++i) {
    o.alignment.used[i] = o.alignment.used[i] && o.alignment.leg[i] >= *first_leg;
    if (o.alignment.used[i]) {
      append_rows(o,
                  point_on_path(series.segments[i], i, o.alignment, path, o.target_offset_m, noise),
                  sub_points(series, i, o.alignment, path, o.target_offset_m));
      ++o.segments_used;
    }
    if ((i + 1) % 1000 == 0) {
      report(options, Stage::Observe,
             static_cast<double>(i + 1) / static_cast<double>(series.segments.size()));
      ABBE_TRY(check_stopped(options.stopped));
    }
  }

  o.covered_m = covered(o, path, options.corner_m);
  return o;
}

}  // namespace abbe::calib::otf
