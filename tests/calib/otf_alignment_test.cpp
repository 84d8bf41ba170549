#include "abbe/calib/otf/observe/alignment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using namespace abbe::tests::otf;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(LegAssignment, FindsTheTurningPointOfLegsOnOneLine) {
  // Out 30 mm, back 20 mm, on the same line: distances alone do not distinguish the legs.
  const Path path{{{0, 0, 0}, {0.03, 0, 0}, {0.01, 0, 0}}};
  std::vector<Vector3> points;
  for (const double x : {0.002, 0.010, 0.018, 0.026, 0.028, 0.020, 0.012}) {
    points.emplace_back(x, 0, 0);
  }
  const auto leg = assign_legs(points, path, 0.02);
  ASSERT_TRUE(leg);
  EXPECT_THAT(*leg, ElementsAre(0, 0, 0, 0, 1, 1, 1));
}

TEST(LegAssignment, IsNotConfusedByLegsThatCross) {
  // The third leg crosses the first one in its middle.
  const Path path{{{0, 0, 0}, {1, 0, 0}, {0.5, 0.5, 0}, {0.5, -0.5, 0}}};
  std::vector<Vector3> points;
  std::vector<std::size_t> truth;
  for (std::size_t l = 0; l < 3; ++l) {
    for (int k = 0; k < 20; ++k) {
      points.emplace_back(path.vertices_m[l] +
                          (k + 0.5) / 20 * (path.vertices_m[l + 1] - path.vertices_m[l]));
      truth.push_back(l);
    }
  }
  EXPECT_EQ(assign_legs(points, path, 0.02).value(), truth);
}

TEST(LegAssignment, GoesOnThroughLostSegments) {
  const Path path{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}};
  const double nan = std::nan("");
  std::vector<Vector3> points{{0.1, 0, 0},     {0.5, 0, 0}, {nan, nan, nan},
                              {nan, nan, nan}, {1, 0.5, 0}, {1, 0.9, 0}};
  const auto leg = assign_legs(points, path, 0.02);
  ASSERT_TRUE(leg);
  EXPECT_EQ(leg->at(1), 0u);
  EXPECT_EQ(leg->at(4), 1u);
}

/// Squared distance from the leg, and (0.02 m)^2 (1 - cos) of the angle between travel and leg.
double cost_on_leg(const std::vector<Vector3>& points, std::size_t i, const Path& path,
                   std::size_t leg) {
  const Vector3 from = path.vertices_m[leg], way = path.vertices_m[leg + 1] - from;
  const double share = std::clamp((points[i] - from).dot(way) / way.squaredNorm(), 0.0, 1.0);
  const Vector3 travel = points[std::min(i + 1, points.size() - 1)] - points[i == 0 ? 0 : i - 1];
  const double cosine = travel.dot(way) / travel.norm() / way.norm();
  return (points[i] - from - share * way).squaredNorm() + 0.02 * 0.02 * (1.0 - cosine);
}

/// The assignment with the lowest cost among those that visit all legs in order.
std::vector<std::size_t> cheapest(const std::vector<Vector3>& points, const Path& path) {
  const std::size_t n = points.size(), m = path.vertices_m.size() - 1;
  std::vector<bool> advances(n - 1, false);
  std::fill(advances.end() - static_cast<std::ptrdiff_t>(m - 1), advances.end(), true);
  std::vector<std::size_t> best;
  double least = std::numeric_limits<double>::infinity();
  do {
    std::vector<std::size_t> leg{0};
    for (const bool advance : advances) leg.push_back(leg.back() + (advance ? 1 : 0));
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) sum += cost_on_leg(points, i, path, leg[i]);
    if (sum < least) least = sum, best = leg;
  } while (std::next_permutation(advances.begin(), advances.end()));

  return best;
}

TEST(LegAssignment, IsTheCheapestOfAll) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal(0.0, 0.05);
  const auto place = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  for (const auto& [n, m] : {std::pair{9, 4}, {9, 9}, {9, 8}, {10, 2}, {7, 1}}) {
    Path path;
    std::vector<Vector3> points;
    for (int i = 0; i <= m; ++i) path.vertices_m.push_back(place());
    for (int i = 0; i < n; ++i) points.push_back(place());
    EXPECT_EQ(assign_legs(points, path, 0.02).value(), cheapest(points, path))
        << n << " segments, " << m << " legs";
  }
}

TEST(LegAssignment, NeedsASegmentForEveryLeg) {
  const Path path{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}};
  EXPECT_FALSE(assign_legs(std::vector<Vector3>{{0, 0, 0}}, path, 0.02));
}

/// Case A from its published segment means; the machine's positions at the ends are computed with
/// the rough transform.
SegmentSeries case_a_series(const ReferenceSegments& segments) {
  const RigidTransform rough = case_a_rough_alignment_noisy(), fine = case_a_alignment(true);
  const Path path = case_a_path();
  const Vector3 t = case_a_machine().target_offset_m;
  const Vector3 start = rough.R.transpose() * (path.vertices_m.front() + t - rough.t_m);
  const Vector3 end = fine.R.transpose() * (path.vertices_m.back() + t - fine.t_m);
  return *segments_from_means(segments.means_tracker_m, start, end, {});
}

TEST(Alignment, OfTheReferenceSegmentsIsThePrototypes) {
  const ReferenceSegments segments = case_a_segments();
  const Result<Alignment> a = align(case_a_series(segments), case_a_machine(), case_a_path(), {});
  ASSERT_TRUE(a) << a.error().text;
  const RigidTransform reference = case_a_alignment(true);
  // The means are printed to 1e-9 m and the end is not a measured one; with samples the agreement
  // is 1e-8, see CaseAStream.
  EXPECT_LT((a->T_machine_tracker.R - reference.R).cwiseAbs().maxCoeff(), 3e-8);
  EXPECT_LT((a->T_machine_tracker.t_m - reference.t_m).cwiseAbs().maxCoeff(), 3e-8);
  EXPECT_EQ(a->leg, segments.leg);
  EXPECT_EQ(a->used, segments.used);
  EXPECT_EQ(std::count(a->used.begin(), a->used.end(), true), 4663);
  EXPECT_NEAR(a->last_rms_m, 63.4036e-6, 0.001e-6);
}

struct Refusal {
  ErrorCode code{};
  std::string text;
};
Refusal refusal(const MadeRun& run, const Path& path) {
  const auto a = align(*make_segments(run.samples, run.options), run.machine, path, run.options);
  return a ? Refusal{{}, "accepted"} : Refusal{a.error().code, a.error().text};
}

TEST(Alignment, RefusesAPathOnALine) {
  const MadeRun run = make_run({});
  const Refusal r = refusal(run, Path{{{0, 0, 0}, {0.1, 0, 0}, {0.3, 0, 0}}});
  EXPECT_EQ(r.code, ErrorCode::DegenerateGeometry);
  EXPECT_THAT(r.text, HasSubstr("line"));
}

TEST(Alignment, RefusesThePathOfAnotherRunByLength) {
  const MadeRun run = make_run({});
  Path other = run.path;
  other.vertices_m.resize(61);
  const Refusal r = refusal(run, other);
  EXPECT_EQ(r.code, ErrorCode::AlignmentFailed);
  EXPECT_THAT(r.text, HasSubstr("m of travel"));
}

TEST(Alignment, RefusesAPathOfTheRightLengthButAnotherShape) {
  const MadeRun run = make_run({});
  Path other = run.path;
  for (Vector3& v : other.vertices_m) {
    v.y() = -v.y();  // the mirror image: no rotation maps it to the path
  }
  const Refusal r = refusal(run, other);
  EXPECT_EQ(r.code, ErrorCode::AlignmentFailed);
  EXPECT_THAT(r.text, HasSubstr("they fit with"));
  EXPECT_THAT(r.text, HasSubstr("reversed"));
}

TEST(Alignment, NamesAPathThatWasDrivenBackwards) {
  const MadeRun run = make_run({});
  Path other = run.path;
  std::reverse(other.vertices_m.begin(), other.vertices_m.end());
  EXPECT_THAT(refusal(run, other).text, HasSubstr("they fit with the path driven backwards"));
}

TEST(Alignment, NamesAPathInMetres) {
  const MadeRun run = make_run({});
  Path other = run.path;
  for (Vector3& v : other.vertices_m) v *= 1e-3;
  EXPECT_THAT(refusal(run, other).text,
              HasSubstr("they fit with lengths in m instead of mm (path)"));
}

TEST(Alignment, RefusesARunThatEndsEarly) {
  MadeRun run = make_run({});
  run.samples.resize(run.samples.size() - 400);  // 0.8 s: less than the length check detects
  EXPECT_EQ(refusal(run, run.path).code, ErrorCode::AlignmentFailed);
}

TEST(Alignment, RefusesVerticesThatAreNaNOrCoincide) {
  const MadeRun run = make_run({});
  Path broken = run.path;
  broken.vertices_m[5].x() = std::nan("");
  EXPECT_EQ(refusal(run, broken).code, ErrorCode::NotFinite);
  broken = run.path;
  broken.vertices_m[5] = broken.vertices_m[4];
  EXPECT_EQ(refusal(run, broken).code, ErrorCode::BadInput);
}

}  // namespace
