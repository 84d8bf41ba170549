#include "abbe/calib/otf/observe/segments.hpp"

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

TEST(Segments, AreMeansOfConsecutiveSamples) {
  const Result<SegmentSeries> series = make_segments(straight(1050), {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->segments.size(), 10u);
  EXPECT_NEAR(series->segments[3].mean_tracker_m.x(), 1e-3 * (300 + 399) / 2, 1e-15);
  EXPECT_EQ(series->segments[3].samples, 100u);
}

TEST(Segments, StartAtTheMeanOfTheStandstill) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 0; i < 25; ++i) {
    samples[i].p_tracker_m.x() = i % 2 == 0 ? 1e-6 : -1e-6;
  }
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  EXPECT_NEAR(series->start_tracker_m.x(), 0.0, 1e-15);
}

TEST(Segments, SamplesAfterAShortStandstillDoNotMoveTheStart) {
  // 25 samples at 50 points per second would be half a second; here the machine stood for 0.1 s.
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 0; i < 5; ++i) {
    samples[i].p_tracker_m.x() = 0.005;
  }
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  EXPECT_NEAR(series->start_tracker_m.x(), 0.005, 1e-3);
}

TEST(Segments, OfFewSamplesHaveTheirSamplesAsSubPoints) {
  Options options;
  options.segment_samples = 2;
  const Result<SegmentSeries> series = make_segments(straight(100), options);
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->sub_points, 2u);
  EXPECT_NEAR(series->sub_points_tracker_m[6].x(), 6e-3, 1e-15);
  EXPECT_NEAR(series->sub_points_tracker_m[7].x(), 7e-3, 1e-15);
}

TEST(Segments, SubPointsHaveTheMeanOfTheSegment) {
  Options options;
  options.row_points = 7;
  const Result<SegmentSeries> series = make_segments(straight(1000), options);
  ASSERT_TRUE(series);
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < 7; ++k) {
    sum += series->sub_points_tracker_m[series->segments[2].first_sub_point + k];
  }
  EXPECT_LT((sum / 7 - series->segments[2].mean_tracker_m).norm(), 1e-14);
}

TEST(Segments, KeepTimeThroughInvalidSamples) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 240; i < 460; ++i) {
    samples[i].valid = false;
    samples[i].p_tracker_m.setConstant(std::nan(""));
  }
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->segments.size(), 10u);
  EXPECT_FALSE(series->segments[2].usable);  // 40 of 100
  EXPECT_EQ(series->segments[3].samples, 0u);
  EXPECT_EQ(series->lost_samples, 220u);
  EXPECT_NEAR(series->segments[5].mean_tracker_m.x(), 1e-3 * (500 + 599) / 2, 1e-15);
}

TEST(Segments, AHoleInTimeCountsLikeInvalidSamples) {
  std::vector<TrackerObservation> samples = straight(1000);
  samples.erase(samples.begin() + 240, samples.begin() + 460);
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_TRUE(series) << series.error().text;
  ASSERT_EQ(series->segments.size(), 10u);
  EXPECT_EQ(series->lost_samples, 220u);
  EXPECT_NEAR(series->segments[5].mean_tracker_m.x(), 1e-3 * (500 + 599) / 2, 1e-15);
}

TEST(Segments, SubPointsOfAHalfLostSegmentFollowItsMean) {
  std::vector<TrackerObservation> samples = straight(1000);
  for (std::size_t i = 260; i < 300; ++i) {
    samples[i].valid = false;
  }
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_TRUE(series);
  EXPECT_TRUE(series->segments[2].usable);
  Vector3 sum = Vector3::Zero();
  for (std::size_t k = 0; k < 10; ++k) {
    sum += series->sub_points_tracker_m[series->segments[2].first_sub_point + k];
  }
  EXPECT_LT((sum / 10 - series->segments[2].mean_tracker_m).norm(), 1e-14);
}

TEST(Segments, RefuseTooFewSamples) {
  EXPECT_EQ(make_segments(straight(399), {}).error().code, ErrorCode::TooFewObservations);
  EXPECT_EQ(make_segments({}, {}).error().code, ErrorCode::TooFewObservations);
}

TEST(Segments, RefuseNaNAndSayWhere) {
  std::vector<TrackerObservation> samples = straight(1000);
  samples[123].p_tracker_m.y() = std::nan("");
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_FALSE(series);
  EXPECT_EQ(series.error().code, ErrorCode::NotFinite);
  EXPECT_THAT(series.error().text, HasSubstr("sample 123"));
}

TEST(Segments, RefuseTimeThatRunsBackwards) {
  std::vector<TrackerObservation> samples = straight(1000);
  std::swap(samples[500], samples[501]);
  const Result<SegmentSeries> series = make_segments(samples, {});
  ASSERT_FALSE(series);
  EXPECT_EQ(series.error().code, ErrorCode::BadInput);
  EXPECT_THAT(series.error().text, HasSubstr("sample 501"));
}

}  // namespace
