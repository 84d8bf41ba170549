#include "abbe/calib/otf/judge/placed_residuals.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/otf/identify/identify.hpp"
#include "abbe/calib/otf/observe/segments.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;

/// The point of the path at a length from its first vertex.
Vector3 on_path(const Path& path, double way_m) {
  for (std::size_t i = 0; i + 1 < path.vertices_m.size(); ++i) {
    const Vector3 leg_m = path.vertices_m[i + 1] - path.vertices_m[i];
    if (way_m <= leg_m.norm()) return path.vertices_m[i] + way_m * leg_m.normalized();
    way_m -= leg_m.norm();
  }
  return path.vertices_m.back();
}

TEST(PlacedResiduals, AreAtTheirPlacesOnThePath) {
  const MadeRun run = make_run({});
  const auto id = *identify(run.samples, run.machine, run.path, run.noise, run.options);
  const auto placed = placed_residuals(id.observations, id.solution.residuals);
  ASSERT_EQ(placed.size(), id.observations.rows.size());
  for (std::size_t i = 0; i < placed.size(); ++i) {
    EXPECT_LT((placed[i].axis_position_m - on_path(run.path, placed[i].way_m)).norm(), 1e-9);
    EXPECT_EQ(placed[i].after_m, id.solution.residuals.after_m[i]);
    EXPECT_FALSE(placed[i].held_out);
  }
}

/// Mean time of the valid samples of a segment.
double mean_time_s(const MadeRun& run, const Segment& segment) {
  double sum_s = 0.0;
  std::size_t count = 0;
  for (std::size_t i = segment.begin_sample; i < segment.end_sample; ++i) {
    if (!run.samples[i].valid) continue;
    sum_s += run.samples[i].time_s;
    ++count;
  }
  return sum_s / static_cast<double>(count);
}

TEST(PlacedResiduals, HaveTheTimeOfTheirSegment) {
  const MadeRun run = make_run({});
  const SegmentSeries series = *make_segments(run.samples, run.options);
  const Observations o = *observe_segments(series, run.machine, run.path, run.noise, run.options);
  ASSERT_GT(o.rows.size(), 100u);
  const Residuals none{.before_m = std::vector<double>(o.rows.size(), 0.0),
                       .after_m = std::vector<double>(o.rows.size(), 0.0)};
  for (const Observations& rows : {o, with_basis(o, o.basis)}) {
    const auto placed = placed_residuals(rows, none);
    for (std::size_t i = 0; i < placed.size(); ++i) {
      ASSERT_TRUE(placed[i].time_s);
      EXPECT_NEAR(*placed[i].time_s, mean_time_s(run, series.segments[o.rows[i].segment]), 1e-9);
      EXPECT_EQ(placed[i].leg, o.rows[i].leg);
    }
  }
}

TEST(PlacedResiduals, OfSegmentsWithoutTimesHaveNone) {
  const MadeRun run = make_run({});
  SegmentSeries series = *make_segments(run.samples, run.options);
  series.period_s = 0.0;
  const Observations o = *observe_segments(series, run.machine, run.path, run.noise, run.options);
  const std::vector<double> zeros(o.rows.size(), 0.0);
  for (const auto& placed : placed_residuals(o, {.before_m = zeros, .after_m = zeros}))
    EXPECT_FALSE(placed.time_s);
}

TEST(PlacedResiduals, OfHeldOutRowsGiveTheFiguresOfTheVerdict) {
  const MadeRun run = make_run({});
  const auto id = *identify(run.samples, run.machine, run.path, run.noise, run.options);
  std::vector<std::vector<PlacedResidual>> runs{
      placed_residuals(id.observations, id.solution.residuals)};
  const auto verdict =
      judge(id.observations, id.solution, nullptr, {}, run.options, held_out_into(runs));
  ASSERT_TRUE(verdict);

  double none = 0.0, candidate = 0.0;
  std::size_t count = 0;
  for (const PlacedResidual& r : runs.front()) {
    if (!r.held_out) continue;
    ++count;
    none += std::pow(r.held_out->no_compensation_m / r.sigma_m, 2);
    candidate += std::pow(r.held_out->candidate_m / r.sigma_m, 2);
  }
  const auto n = static_cast<double>(count);
  EXPECT_EQ(count, verdict->held_out.observations);
  EXPECT_NEAR(std::sqrt(none / n), verdict->held_out.no_compensation,
              1e-9 * verdict->held_out.no_compensation);
  EXPECT_NEAR(std::sqrt(candidate / n), verdict->held_out.candidate, 1e-9);
}

}  // namespace
