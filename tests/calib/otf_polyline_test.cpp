#include "abbe/calib/otf/run/polyline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/otf/observe/segments.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using testing::HasSubstr;

const Path kBent{{{0, 0, 0}, {0.3, 0, 0}, {0.3, 0.4, 0}}};

TEST(Polyline, FindsTheNearestPointOfALegWithItsEnds) {
  const Vector3 from(0, 0, 0), to(0.2, 0, 0);
  const OnLeg beside = nearest_on_leg(from, to, {0.05, 0.03, 0.04});
  EXPECT_NEAR(beside.along_m, 0.05, 1e-15);
  EXPECT_NEAR(beside.off_m, 0.05, 1e-15);
  const OnLeg behind = nearest_on_leg(from, to, {0.23, 0.04, 0});
  EXPECT_NEAR(behind.along_m, 0.2, 1e-15);
  EXPECT_NEAR(behind.off_m, 0.05, 1e-15);
  EXPECT_NEAR(nearest_on_leg(from, from, {0.3, 0.4, 0}).off_m, 0.5, 1e-15);
}

TEST(Polyline, DistanceToAPathIsThatToItsNearestLeg) {
  EXPECT_NEAR(distance_to_path_m(kBent, {0.31, 0.2, 0}), 0.01, 1e-15);
  EXPECT_TRUE(std::isinf(distance_to_path_m(Path{{{0, 0, 0}}}, {0, 0, 0})));
}

TEST(Polyline, MeasuresItsWay) {
  const auto lengths = lengths_to_vertices_m(kBent);
  ASSERT_EQ(lengths.size(), 3u);
  EXPECT_EQ(lengths[0], 0.0);
  EXPECT_NEAR(lengths[1], 0.3, 1e-15);
  EXPECT_NEAR(lengths[2], 0.7, 1e-15);
}

/// Three axes that travel from -0.1 m to 0.5 m.
MachineNodes travel() {
  const AxisNodes nodes = *equidistant_nodes(-0.1, 0.5);
  return {nodes, nodes, nodes};
}

TEST(PathCheck, TakesAPathThatCanBeIdentified) {
  EXPECT_TRUE(check(kBent, travel()));
}

TEST(PathCheck, RefusesAPathThatEndsWhereItBegins) {
  const auto refused = check(Path{{{0, 0, 0}, {0.3, 0, 0}, {0.3, 0.4, 0}, {0, 0, 0}}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::DegenerateGeometry);
}

TEST(PathCheck, RefusesTwoVertices) {
  const auto refused = check(Path{{{0, 0, 0}, {0.3, 0, 0}}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
}

TEST(PathCheck, NamesTheVertexTheAxisAndItsTravel) {
  Path outside = kBent;
  outside.vertices_m[2].y() = 0.501;
  const auto refused = check(outside, travel());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::BadInput);
  EXPECT_THAT(refused.error().text,
              HasSubstr("vertex 2 at Y 501 mm, the axis travels -100 to 500 mm"));
}

// X travels -100 to 500 mm, like Y and Z: -500 is inside after a reversal of X.
TEST(PathCheck, NamesTheMistakeThatPutsAllVerticesInside) {
  const auto refused = check(Path{{{0, 0, 0}, {-0.5, 0, 0}, {-0.5, 0.5, 0.5}}}, travel());
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, testing::EndsWith("; all are inside with X reversed"));
  const auto microns = check(Path{{{0, 0, 0}, {300, 0, 0}, {300, 400, 0}}}, travel());
  EXPECT_THAT(microns.error().text, HasSubstr("all are inside with lengths in um instead of mm"));
}

TEST(PathCheck, TakesVerticesAtTheEndsOfTheTravel) {
  EXPECT_TRUE(check(Path{{{-0.1, 0, 0}, {0.5, 0, 0}, {0.5, 0.5, 0.5}}}, travel()));
}

TEST(SegmentLength, IsTheTravelOfEightMillimetres) {
  for (const double speed_m_s : {0.02, 0.05, 0.2}) {
    std::vector<TrackerObservation> samples;
    for (int i = 0; i < 5000; ++i) {
      const double time_s = 0.002 * i;
      // a standstill of two seconds first: it must not affect the length
      samples.push_back(
          {.time_s = time_s, .p_tracker_m = {1.0 + speed_m_s * std::max(0.0, time_s - 2.0), 0, 0}});
    }
    EXPECT_NEAR(static_cast<double>(suitable_segment_samples(samples)),
                8.33e-3 / (0.002 * speed_m_s), 1.0);
  }
}

TEST(SegmentLength, StaysBetweenOneAndAThousand) {
  std::vector<TrackerObservation> standing(1000);
  EXPECT_EQ(suitable_segment_samples(standing), 1000u);
  EXPECT_EQ(suitable_segment_samples({}), 10u);
  std::vector<TrackerObservation> racing;
  for (int i = 0; i < 1000; ++i)
    racing.push_back({.time_s = 0.01 * i, .p_tracker_m = {0.02 * i, 0, 0}});
  EXPECT_EQ(suitable_segment_samples(racing), 1u);
}

TEST(SegmentLength, OfASlowTrackerIgnoresCornersOfThePath) {
  // 2 mm per sample along legs of 30 mm, back and forth: the chord over 50 samples is shorter.
  std::vector<TrackerObservation> zigzag;
  for (int i = 0; i < 1000; ++i) {
    const int along = i % 30;
    zigzag.push_back({.time_s = 0.05 * i,
                      .p_tracker_m = {2e-3 * std::min(along, 30 - along), 1e-3 * (i / 15), 1.0}});
  }
  EXPECT_EQ(suitable_segment_samples(zigzag), 4u);
}

}  // namespace
