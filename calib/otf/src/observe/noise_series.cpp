#include "observe/noise_series.hpp"

#include <cmath>

#include "abbe/calib/internal/statistics/median.hpp"

namespace abbe::calib::otf {
namespace {

NoiseResponse response_of(const Observations& o, const Observation& row) {
  const RigidTransform& T = o.alignment.T_machine_tracker;
  const Vector3 p = T.R.transpose() * (row.axis_position_m + o.target_offset_m - T.t_m);
  const Vector3 d = T.R.transpose() * row.direction / row.sigma_m;
  const double range_m = p.norm(), level_m = std::sqrt(p.x() * p.x() + p.y() * p.y());
  const Vector3 beam = p / range_m;
  // directly above the tracker the direction of azimuth is arbitrary
  const Vector3 azimuth =
      level_m > 0.0 ? Vector3(-p.y() / level_m, p.x() / level_m, 0.0) : Vector3(Vector3::UnitY());
  return {d.dot(beam), range_m * d.dot(azimuth), range_m * d.dot(beam.cross(azimuth)),
          row.component == kAlong ? 1.0 / row.sigma_m : 0.0};
}

/// Duration of a segment: median time from one to the next; 1 for segments without times.
double segment_duration(const std::vector<double>& segment_s) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < segment_s.size(); ++i) {
    periods_s.push_back(segment_s[i] - segment_s[i - 1]);
  }
  return periods_s.empty() ? 1.0 : median(periods_s);
}

double travel_per_segment_m(const NoiseSeries& all, const Observations& o) {
  std::vector<double> travel_m;
  for (std::size_t i = 1; i < all.segments.size(); ++i) {
    const NoiseSegment &a = all.segments[i - 1], &b = all.segments[i];
    if (a.leg == b.leg) {
      travel_m.push_back(
          (o.rows[b.first_row].axis_position_m - o.rows[a.first_row].axis_position_m).norm());
    }
  }
  return travel_m.empty() ? 0.0 : median(travel_m);
}

}  // namespace

NoiseSeries noise_series(const Observations& o) {
  const double duration = segment_duration(o.segment_s);
  NoiseSeries series;
  series.sources = kNoiseSources - 1;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    const Observation& row = o.rows[i];
    if (i == 0 || row.segment != o.rows[i - 1].segment) {
      const double middle =
          o.segment_s.empty() ? static_cast<double>(row.segment) : o.segment_s[row.segment];
      series.segments.push_back(
          {middle - 0.5 * duration, middle + 0.5 * duration, row.leg, i, std::size_t{0}});
    }
    ++series.segments.back().rows;
    series.response.push_back(response_of(o, row));
    if (row.component == kAlong) {
      series.sources = kNoiseSources;
    }
  }
  return series;
}

GroupedSeries grouped(const NoiseSeries& all, const Observations& o, double group_m) {
  GroupedSeries g;
  g.series.sources = all.sources;
  const double gap = 0.5 * all.segment_duration();
  const double segment_m = travel_per_segment_m(all, o);
  const auto at_m = [&](const NoiseSegment& b) { return o.rows[b.first_row].axis_position_m; };
  Vector3 first_m = Vector3::Zero();
  for (const NoiseSegment& b : all.segments) {
    const bool continues = !g.series.segments.empty() && b.leg == g.series.segments.back().leg &&
                           b.rows == g.series.segments.back().rows &&
                           b.begin - g.series.segments.back().end < gap &&
                           (at_m(b) - first_m).norm() < group_m - 0.5 * segment_m;
    if (!continues) {
      first_m = at_m(b);
      g.series.segments.push_back({b.begin, b.end, b.leg, g.rows.size(), b.rows});
      g.rows.resize(g.rows.size() + b.rows);
    }
    g.series.segments.back().end = b.end;
    for (std::size_t k = 0; k < b.rows; ++k) {
      g.rows[g.series.segments.back().first_row + k].push_back(b.first_row + k);
    }
  }

  for (const std::vector<std::size_t>& rows : g.rows) {
    NoiseResponse sum{};
    for (const std::size_t i : rows) {
      for (std::size_t s = 0; s < kNoiseSources; ++s) {
        sum[s] += all.response[i][s] / std::sqrt(static_cast<double>(rows.size()));
      }
    }
    g.series.response.push_back(sum);
  }
  return g;
}

RowMatrix GroupedSeries::sums(const RowMatrix& of_rows) const {
  RowMatrix sum = RowMatrix::Zero(std::ssize(rows), of_rows.cols());
  for (std::size_t g = 0; g < rows.size(); ++g) {
    for (const std::size_t i : rows[g]) {
      sum.row(static_cast<Eigen::Index>(g)) += of_rows.row(static_cast<Eigen::Index>(i));
    }
    sum.row(static_cast<Eigen::Index>(g)) /= std::sqrt(static_cast<double>(rows[g].size()));
  }
  return sum;
}

}  // namespace abbe::calib::otf
