#include "abbe/calib/otf/observe/blocks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace {
using namespace abbe::calib;
using namespace abbe::calib::otf;
using testing::HasSubstr;

/// Moves 1 mm in x per sample.
std::vector<TrackerObservation> straight(std::size_t n) {
  std::vector<TrackerObservation> samples;
  for (std::size_t i = 0; i < n; ++i) {
    const double s = static_cast<double>(i);
    samples.push_back({0.002 * s, Vector3(1e-3 * s, 2.0, 3.0), true});
  }
  return samples;
}

TEST(Blocks, AreMeansOfConsecutiveSamples) {
  const Result<BlockSeries> series = make_blocks(straight(1050), {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->blocks.size(), 10u);
  EXPECT_NEAR(series->blocks[3].mean_tracker_m.x(), 1e-3 * (300 + 399) / 2, 1e-15);
  EXPECT_EQ(series->blocks[3].samples, 100u);
}

TEST(Blocks, StartAtTheMeanOfTheStandstill) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 0; i < 25; ++i) {
    samples[i].p_tracker_m.x() = i % 2 == 0 ? 1e-6 : -1e-6;
  }
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  EXPECT_NEAR(series->start_tracker_m.x(), 0.0, 1e-15);
}

TEST(Blocks, SamplesAfterAShortStandstillDoNotMoveTheStart) {
  // 25 samples at 50 points per second would be half a second; here the machine stood for 0.1 s.
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 0; i < 5; ++i) {
    samples[i].p_tracker_m.x() = 0.005;
  }
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  EXPECT_NEAR(series->start_tracker_m.x(), 0.005, 1e-3);
}

TEST(Blocks, OfFewSamplesHaveTheirSamplesAsSubPoints) {
  Options options;
  options.block_samples = 2;
  const Result<BlockSeries> series = make_blocks(straight(100), options);
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->sub_points, 2u);
  EXPECT_NEAR(series->sub_points_tracker_m[6].x(), 6e-3, 1e-15);
  EXPECT_NEAR(series->sub_points_tracker_m[7].x(), 7e-3, 1e-15);
}

TEST(Blocks, SubPointsHaveTheMeanOfTheBlock) {
  Options options;
  options.row_points = 7;
  const Result<BlockSeries> series = make_blocks(straight(1000), options);
  ASSERT_TRUE(series);
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < 7; ++k) {
    sum += series->sub_points_tracker_m[series->blocks[2].first_sub_point + k];
  }
  EXPECT_LT((sum / 7 - series->blocks[2].mean_tracker_m).norm(), 1e-14);
}

TEST(Blocks, KeepTimeThroughInvalidSamples) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 240; i < 460; ++i) {
    samples[i].valid = false;
    samples[i].p_tracker_m.setConstant(std::nan(""));
  }
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->blocks.size(), 10u);
  EXPECT_FALSE(series->blocks[2].usable);  // 40 of 100
  EXPECT_EQ(series->blocks[3].samples, 0u);
  EXPECT_EQ(series->lost_samples, 220u);
  EXPECT_NEAR(series->blocks[5].mean_tracker_m.x(), 1e-3 * (500 + 599) / 2, 1e-15);
}

TEST(Blocks, AHoleInTimeCountsLikeInvalidSamples) {
  std::vector<TrackerObservation> samples = straight(1000);
  samples.erase(samples.begin() + 240, samples.begin() + 460);
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->blocks.size(), 10u);
  EXPECT_EQ(series->lost_samples, 220u);
  EXPECT_NEAR(series->blocks[5].mean_tracker_m.x(), 1e-3 * (500 + 599) / 2, 1e-15);
}

TEST(Blocks, SubPointsOfAHalfLostBlockFollowItsMean) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 260; i < 300; ++i) {
    samples[i].valid = false;
  }
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_TRUE(series);
  EXPECT_TRUE(series->blocks[2].usable);
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < 10; ++k) {
    sum += series->sub_points_tracker_m[series->blocks[2].first_sub_point + k];
  }
  EXPECT_LT((sum / 10 - series->blocks[2].mean_tracker_m).norm(), 1e-14);
}

TEST(Blocks, RefuseTooFewSamples) {
  EXPECT_EQ(make_blocks(straight(399), {}).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(make_blocks({}, {}).error().code, ErrorCode::TooFewObservations);
}

TEST(Blocks, RefuseNaNAndSayWhere) {
  std::vector<TrackerObservation> samples = straight(1000);
  samples[123].p_tracker_m.y() = std::nan("");
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_FALSE(series);
  EXPECT_EQ(series.error().code, ErrorCode::NotFinite);
  EXPECT_THAT(series.error().text, HasSubstr("sample 123"));
}

TEST(Blocks, RefuseTimeThatRunsBackwards) {
  std::vector<TrackerObservation> samples = straight(1000);
  std::swap(samples[500], samples[501]);
  const Result<BlockSeries> series = make_blocks(samples, {});
  ASSERT_FALSE(series);
  EXPECT_EQ(series.error().code, ErrorCode::BadInput);
  EXPECT_THAT(series.error().text, HasSubstr("sample 501"));
}

}  // namespace
