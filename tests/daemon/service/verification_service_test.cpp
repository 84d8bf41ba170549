#include "abbe/service/verification_service.hpp"

#include <gmock/gmock.h>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::Snapshot;

Config watched() {
  Config config;
  config.of<TrackerConfig>().emplace().host = "127.0.0.1";
  return config;
}

std::vector<Snapshot> standstill(std::chrono::nanoseconds from, double x) {
  std::vector<Snapshot> all;
  for (auto t = from; t < from + 3s; t += 100ms) {
    Snapshot& s = all.emplace_back();
    s.head.time = protocol::HostTime{t};
    s.axis_count = 3;
    s.position[0] = x;
    s.has_tracker_point = true;
    s.tracker_point.p_tracker_m = {1.0, x, 0.0};
  }
  return all;
}

TEST(VerificationService, CollectsBetweenBeginAndEnd) {
  const Config config = watched();
  VerificationService service(config);
  service.cycle(standstill(0s, 0.5));
  const auto number = service.begin();
  ASSERT_TRUE(number);
  service.cycle(standstill(10s, 0.1));
  service.cycle(standstill(20s, 0.2));
  EXPECT_EQ((*service.points(*number))->points().size(), 1u);
  ASSERT_TRUE(service.end(*number));
  service.cycle(standstill(30s, 0.3));
  ASSERT_EQ((*service.points(*number))->points().size(), 2u);
  EXPECT_DOUBLE_EQ((*service.points(*number))->points()[1].mean.reading_m.x(), 0.2);
}

TEST(VerificationService, StopsAtItsLimitIfItIsNotEnded) {
  const Config config = watched();
  VerificationService service(config);
  const auto number = service.begin();
  ASSERT_TRUE(number);
  EXPECT_EQ(service.stopped(), "");
  std::vector<Snapshot> points(3, standstill(0s, 0.0).front());  // of one standstill

  for (std::size_t i = 0; i < VerificationService::kMostPoints + 10; ++i) {
    for (std::size_t k = 0; k < points.size(); ++k) {
      points[k].head.time = protocol::HostTime{2s * i + 600ms * k};
      points[k].position[0] = 0.001 * static_cast<double>(i % 2);
    }
    service.cycle(points);
  }

  EXPECT_EQ((*service.points(*number))->points().size(), VerificationService::kMostPoints);
  EXPECT_THAT(service.stopped(), testing::HasSubstr("the limit of 10000 standstills is reached"));
  ASSERT_TRUE(service.end(*number));
  EXPECT_EQ((*service.points(*number))->points().size(), VerificationService::kMostPoints);
  ASSERT_TRUE(service.begin());
  EXPECT_EQ(service.stopped(), "");
}

TEST(VerificationService, BelongsToTheClientThatBeganLast) {
  const Config config = watched();
  VerificationService service(config);
  EXPECT_EQ(service.points(0).error().code, ErrorCode::Refused);
  const auto first = *service.begin(), second = *service.begin();
  EXPECT_EQ(service.points(first).error().code, ErrorCode::Refused);
  EXPECT_EQ(service.end(first).error().code, ErrorCode::Refused);
  EXPECT_TRUE(service.points(second));
}

TEST(VerificationService, RefusesReadingsWithoutInformation) {
  const Config without;
  EXPECT_EQ(VerificationService(without).begin().error().code, ErrorCode::Refused);
  Config compensated = watched();
  compensated.of<EncoderConfig>().emplace().axes_compensated = true;
  EXPECT_THAT(VerificationService(compensated).begin().error().text,
              testing::HasSubstr("axes_compensated"));
}

TEST(VerificationService, WaitsForTheMeansOfASlowTracker) {
  Config config = watched();
  config.of<TrackerConfig>()->mode = TrackerModeConfig::Stationary;
  config.of<TrackerConfig>()->stationary_time = 2s;
  EXPECT_EQ(standstill_options(config).settle, 2s);
}

}  // namespace
}  // namespace abbe::daemon
