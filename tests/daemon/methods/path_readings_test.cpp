/// Scale readings from a file against the vertices of a path.
#include "abbe/methods/otf/path_readings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;

const std::vector<AxisPosition> kPath_m{{0, 0, 0}, {0.1, 0, 0}, {0.1, 0.2, 0}, {0.1, 0.2, -0.05}};

/// 10 readings at every vertex, 1 ms apart, and 9 on the way to the next one.
std::vector<EncoderRow> driven(const std::vector<AxisPosition>& path_m, bool stands = true) {
  std::vector<EncoderRow> rows;
  double time_s = 0.0;
  const auto add = [&](const AxisPosition& q_m) { rows.push_back({time_s += 1e-3, q_m}); };
  for (std::size_t i = 0; i < path_m.size(); ++i) {
    for (int k = 0; k < (stands ? 10 : 1); ++k) add(path_m[i]);
    for (int k = 1; i + 1 < path_m.size() && k < 10; ++k) {
      AxisPosition q_m = path_m[i];
      for (std::size_t a = 0; a < 3; ++a) q_m[a] += 0.1 * k * (path_m[i + 1][a] - path_m[i][a]);
      add(q_m);
    }
  }
  return rows;
}

constexpr double kTolerance_m = 20e-6;

TEST(PathReadings, OfTheSamePathAgreeAtEveryVertex) {
  const auto stood = compare_with_path("e.csv", driven(kPath_m), kPath_m, kTolerance_m);
  ASSERT_TRUE(stood) << stood.error().text;
  EXPECT_EQ(*stood, kPath_m.size());
}

TEST(PathReadings, AMachineThatNeverStandsIsComparedNowhere) {
  const auto stood = compare_with_path("e.csv", driven(kPath_m, false), kPath_m, kTolerance_m);
  ASSERT_TRUE(stood) << stood.error().text;
  EXPECT_EQ(*stood, 0u);
}

TEST(PathReadings, AVertexDrivenAtAnotherPlaceIsNamed) {
  auto other = kPath_m;
  other[2][1] += 30e-6;
  const auto stood = compare_with_path("e.csv", driven(other), kPath_m, kTolerance_m);
  ASSERT_FALSE(stood);
  EXPECT_EQ(stood.error().code, ErrorCode::BadInput);
  EXPECT_THAT(stood.error().text,
              HasSubstr("e.csv: the scales contradict the path: at vertex 2 Y reads 200.030 mm"));
}

TEST(PathReadings, ALastVertexDrivenAtAnotherPlaceIsNamedToo) {
  auto other = kPath_m;
  other.back()[2] -= 30e-6;
  const auto stood = compare_with_path("e.csv", driven(other), kPath_m, kTolerance_m);
  ASSERT_FALSE(stood);
  EXPECT_THAT(stood.error().text, HasSubstr("at vertex 3 Z reads -50.030 mm"));
}

TEST(PathReadings, AVertexOutOfReachIsNamedWithTheClosestReading) {
  auto other = kPath_m;
  other[1][0] = 0.08;
  const auto stood = compare_with_path("e.csv", driven(other), kPath_m, kTolerance_m);
  ASSERT_FALSE(stood);
  EXPECT_THAT(stood.error().text,
              HasSubstr("do not reach vertex 1 of the path, (100.000, 0.000, 0.000) mm"));
}

/// The readings do not show at which of two vertices 3 mm apart the machine stands.
TEST(PathReadings, VerticesCloseToEachOtherAreNotCompared) {
  std::vector<AxisPosition> path_m{{0, 0, 0}, {0.1, 0, 0}, {0.103, 0, 0}, {0.2, 0, 0}};
  const auto stood = compare_with_path("e.csv", driven(path_m), path_m, kTolerance_m);
  ASSERT_TRUE(stood) << stood.error().text;
  EXPECT_EQ(*stood, 2u);
}

TEST(PathReadings, FewerThanTwoReadingsAreRefused) {
  EXPECT_FALSE(
      compare_with_path("e.csv", std::vector<EncoderRow>{{0.0, {}}}, kPath_m, kTolerance_m));
}

}  // namespace
}  // namespace abbe::daemon
