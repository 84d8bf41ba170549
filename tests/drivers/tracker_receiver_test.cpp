#include "abbe/drivers/tracker/receiver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "tracker_script.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::DeviceTime;
using protocol::EnvironmentSample;
using protocol::HostTime;
using protocol::SampleFlag;
using protocol::TrackerPoint;
using tests::tracker::burst;
using tests::tracker::Bytes;
using tests::tracker::point;
using tests::tracker::points_until;

class TrackerReceiverTest : public testing::Test {
 protected:
  void push(std::span<const std::byte> bytes, HostTime arrival) {
    receiver_->push(bytes, arrival);
    while (const auto message = receiver_->next()) {
      if (const auto* b = std::get_if<TrackerBurst>(&*message)) {
        points_.insert(points_.end(), b->points.begin(), b->points.end());
      } else if (const auto* e = std::get_if<EnvironmentSample>(&*message)) {
        weather_.push_back(*e);
      } else if (const auto* n = std::get_if<TrackerProtocolError>(&*message)) {
        malformed_.push_back(*n);
      } else {
        ++others_;
      }
    }
  }
  /// The tracker's clock is `kOffset` before the host's, its packets take 1 ms.
  static DeviceTime device(HostTime t) { return DeviceTime{t.time_since_epoch() - kOffset}; }
  void packet_at(HostTime arrival, int count, const emscon::MultiHead& head = {}) {
    push(burst(points_until(device(arrival - kDelay), count, 2ms), head), arrival);
  }
  void stream_until(HostTime end) {
    for (; now_ < end; now_ += 332ms) packet_at(now_, 166);
  }
  void begin_connection() {
    push({}, now_);
    push(tests::tracker::ok(emscon::Command::StartMeasurement), now_);
  }
  static bool has_flag(const TrackerPoint& p, SampleFlag f) {
    return protocol::has(p.head.flags, f);
  }

  static constexpr auto kOffset = 1000s;
  static constexpr auto kDelay = 1ms;
  HostTime now_{1h};
  std::unique_ptr<TrackerReceiver> receiver_ = std::make_unique<TrackerReceiver>();
  std::vector<TrackerPoint> points_;
  std::vector<EnvironmentSample> weather_;
  std::vector<TrackerProtocolError> malformed_;
  int others_ = 0;
};

TEST_F(TrackerReceiverTest, ConvertsMillimetresToMetres) {
  push(burst(std::array{point(DeviceTime{1s}, {1000, 2000, -300})}), now_);
  ASSERT_EQ(points_.size(), 1u);
  EXPECT_THAT(points_[0].p_tracker_m,
              testing::ElementsAre(testing::DoubleEq(1.0), testing::DoubleEq(2.0),
                                   testing::DoubleEq(-0.3)));
  EXPECT_EQ(points_[0].device_time, DeviceTime{1s});
}

TEST_F(TrackerReceiverTest, StampsPointsWithWhenTheyWereMeasuredNotWhenTheyCame) {
  stream_until(now_ + 60s);
  ASSERT_GT(points_.size(), 20'000u);
  for (std::size_t k = points_.size() - 1000; k < points_.size(); ++k) {
    const HostTime truth{points_[k].device_time.time_since_epoch() + kOffset};
    EXPECT_LE(std::chrono::abs(points_[k].head.time - truth), 2ms);
    EXPECT_LE(std::chrono::abs(points_[k].head.time - truth), 3 * points_[k].head.u_time);
  }
  EXPECT_FALSE(has_flag(points_.back(), SampleFlag::ClockUnsettled));
}

TEST_F(TrackerReceiverTest, MarksPointsWhileTheClockIsNotSettled) {
  packet_at(now_, 10);
  EXPECT_TRUE(has_flag(points_.back(), SampleFlag::ClockUnsettled));
}

struct StatusFlag {
  const char* name;
  emscon::PointStatus status;
  SampleFlag flag;
};
class TrackerReceiverStatus : public TrackerReceiverTest,
                              public testing::WithParamInterface<StatusFlag> {};
TEST_P(TrackerReceiverStatus, BecomesAFlagAndStaysBesideIt) {
  push(burst(std::array{point(DeviceTime{1s}, {1, 2, 3}, GetParam().status)}), now_);
  ASSERT_EQ(points_.size(), 1u);
  const auto quality = SampleFlag::SpeedWarning | SampleFlag::SpeedExceeded |
                       SampleFlag::PointInvalid | SampleFlag::DeviceError;
  EXPECT_EQ(points_[0].head.flags & quality, static_cast<protocol::SampleFlags>(GetParam().flag));
  EXPECT_EQ(points_[0].device_status, static_cast<std::int32_t>(GetParam().status));
}
INSTANTIATE_TEST_SUITE_P(
    Point, TrackerReceiverStatus,
    testing::Values(
        StatusFlag{"Ok", emscon::PointStatus::Ok, SampleFlag::None},
        StatusFlag{"SpeedWarning", emscon::PointStatus::SpeedWarning, SampleFlag::SpeedWarning},
        StatusFlag{"SpeedExceeded", emscon::PointStatus::SpeedExceeded, SampleFlag::SpeedExceeded},
        StatusFlag{"PrismError", emscon::PointStatus::PrismError, SampleFlag::PointInvalid},
        StatusFlag{"Trigger", emscon::PointStatus::TriggerTimeViolation, SampleFlag::PointInvalid},
        StatusFlag{"Unheard", static_cast<emscon::PointStatus>(99), SampleFlag::PointInvalid}),
    [](const auto& status) { return status.param.name; });

TEST_F(TrackerReceiverTest, ABadStatusOfThePacketMarksItsPoints) {
  emscon::MultiHead head;
  head.status = emscon::Status::SystemNotReady;
  packet_at(now_, 3, head);
  for (const auto& p : points_) {
    EXPECT_TRUE(has_flag(p, SampleFlag::DeviceError));
    EXPECT_TRUE(has_flag(p, SampleFlag::PointInvalid));
  }
}

TEST_F(TrackerReceiverTest, ACoordinateThatIsNoNumberIsInvalid) {
  push(burst(std::array{point(DeviceTime{1s}, {1, std::numeric_limits<double>::quiet_NaN(), 3})}),
       now_);
  EXPECT_TRUE(has_flag(points_.at(0), SampleFlag::PointInvalid));
}

TEST_F(TrackerReceiverTest, TakesExtendedResultsLikePlainOnes) {
  const emscon::ExtendedMultiPoint extended{point(DeviceTime{1s}), {}};
  push(tests::tracker::packet(emscon::MultiHead{}, std::span{&extended, 1}), now_);
  ASSERT_EQ(points_.size(), 1u);
  EXPECT_DOUBLE_EQ(points_[0].p_tracker_m[0], 1.0);
}

TEST_F(TrackerReceiverTest, GivesTheSamePointsForAnySplitOfTheBytes) {
  const Bytes bytes = burst(points_until(device(now_), 20, 2ms));
  push(bytes, now_);
  const auto whole = points_;
  for (std::size_t cut = 1; cut < bytes.size(); cut += 7) {
    receiver_ = std::make_unique<TrackerReceiver>();
    points_.clear();
    push(std::span{bytes}.first(cut), now_);
    push(std::span{bytes}.subspan(cut), now_);
    ASSERT_EQ(points_.size(), whole.size()) << cut;
    EXPECT_EQ(points_.back().head.time, whole.back().head.time);
  }
}

// --- holes ---------------------------------------------------------------------------------------

TEST_F(TrackerReceiverTest, AGapIsMarkedWithTheNumberOfLostPoints) {
  push(burst(
           std::array{point(DeviceTime{1s}), point(DeviceTime{1002ms}), point(DeviceTime{1010ms})}),
       now_);
  ASSERT_EQ(points_.size(), 3u);
  EXPECT_FALSE(has_flag(points_[1], SampleFlag::GapBefore));
  EXPECT_TRUE(has_flag(points_[2], SampleFlag::GapBefore));
  EXPECT_EQ(points_[2].head.lost_before, 3u);
  EXPECT_EQ(receiver_->counters().gaps, 1u);
}

TEST_F(TrackerReceiverTest, APointThatIsNotLaterThanTheOneBeforeIsInvalid) {
  push(burst(std::array{point(DeviceTime{1s}), point(DeviceTime{1s}), point(DeviceTime{998ms}),
                        point(DeviceTime{1002ms})}),
       now_);
  EXPECT_FALSE(has_flag(points_.at(0), SampleFlag::PointInvalid));
  EXPECT_TRUE(has_flag(points_.at(1), SampleFlag::PointInvalid));
  EXPECT_TRUE(has_flag(points_.at(2), SampleFlag::PointInvalid));
  EXPECT_FALSE(has_flag(points_.at(3), SampleFlag::PointInvalid));
  EXPECT_EQ(receiver_->counters().time_disorder, 2u);
}

TEST_F(TrackerReceiverTest, TheFirstPointAfterALostBeamIsMarked) {
  stream_until(now_ + 2s);
  const auto before = points_.size();
  push(tests::tracker::packet(
           emscon::ErrorResponse{emscon::Command::StartMeasurement, emscon::Status::Unknown}),
       now_);
  now_ += 5s;
  packet_at(now_, 10);
  ASSERT_EQ(points_.size(), before + 10);
  EXPECT_TRUE(has_flag(points_[before], SampleFlag::BeamReturned));
  EXPECT_FALSE(has_flag(points_[before], SampleFlag::GapBefore));
  EXPECT_FALSE(has_flag(points_[before + 1], SampleFlag::BeamReturned));
  EXPECT_EQ(receiver_->counters().beam_losses, 1u);
}

TEST_F(TrackerReceiverTest, PointsFromBeforeTheBreakDoNotCountAsTheBeamsReturn) {
  packet_at(now_, 10);
  push(tests::tracker::packet(emscon::StatusChange{emscon::Event::MeasurementNotReady}), now_);
  packet_at(now_ + 20ms, 10);  // the ten points that followed without a hole
  packet_at(now_ + 3s, 10);
  ASSERT_EQ(points_.size(), 30u);
  EXPECT_FALSE(has_flag(points_[10], SampleFlag::BeamReturned));
  EXPECT_TRUE(has_flag(points_[20], SampleFlag::BeamReturned));
}

TEST_F(TrackerReceiverTest, AClockThatJumpedBackRestartsItsMapping) {
  stream_until(now_ + 20s);
  const auto before = points_.size();
  push(burst(points_until(DeviceTime{1s}, 10, 2ms)), now_);
  ASSERT_EQ(points_.size(), before + 10);
  EXPECT_TRUE(has_flag(points_[before], SampleFlag::Restarted));
  EXPECT_TRUE(has_flag(points_[before], SampleFlag::ClockUnsettled));
  EXPECT_LE(std::chrono::abs(points_.back().head.time - now_), 50ms);
  EXPECT_EQ(receiver_->clock().restarts, 1u);
}

// --- times that do not fit ---

/// A packet of ten points that arrives at now_, with the time of point `k` moved by `by`.
class TrackerTimes : public TrackerReceiverTest {
 protected:
  std::size_t packet_with(std::size_t k, std::chrono::nanoseconds by) {
    auto points = points_until(device(now_ - kDelay), 10, 2ms);
    points.at(k).time = emscon::TrackerClockReading::from(points[k].time.to_device_time() + by);
    const auto before = points_.size();
    push(burst(points), now_);
    now_ += 332ms;
    return before;
  }
  void expect_only_invalid(std::size_t from, std::size_t bad) {
    for (std::size_t k = from; k < points_.size(); ++k) {
      EXPECT_EQ(has_flag(points_[k], SampleFlag::PointInvalid), k == bad) << k - from;
      EXPECT_LE(std::chrono::abs(points_[k].head.time - now_), 2s) << k - from;
    }
  }
};

TEST_F(TrackerTimes, APointFarAheadIsRefusedAndTheNextOnesAreUsed) {
  for (const auto by : {std::chrono::nanoseconds{1h}, std::chrono::nanoseconds{5s}}) {
    for (const std::size_t k : {0, 4, 9}) {
      receiver_ = std::make_unique<TrackerReceiver>();
      stream_until(now_ + 20s);
      const auto from = packet_with(k, by);
      packet_at(now_, 10);
      packet_at(now_ += 332ms, 10);
      expect_only_invalid(from, from + k);
      EXPECT_EQ(receiver_->counters().time_disorder, 1u);
      EXPECT_EQ(receiver_->clock().restarts, 0u);
    }
  }
}

TEST_F(TrackerTimes, APointFarBehindIsRefusedAndTheClockModelStays) {
  for (const std::size_t k : {0, 4, 9}) {
    receiver_ = std::make_unique<TrackerReceiver>();
    stream_until(now_ + 20s);
    const auto from = packet_with(k, -30min);
    packet_at(now_, 10);
    expect_only_invalid(from, from + k);
    EXPECT_EQ(receiver_->clock().restarts, 0u);
  }
}

TEST_F(TrackerTimes, ACorruptTimeInTheFirstPacketIsRefusedToo) {
  const auto from = packet_with(4, 1h);
  packet_at(now_, 10);
  expect_only_invalid(from, from + 4);
}

TEST_F(TrackerTimes, AJumpThatSeveralPointsAgreeOnBeginsANewClockModel) {
  stream_until(now_ + 20s);
  for (const auto by : {std::chrono::nanoseconds{1h}, std::chrono::nanoseconds{-30min}}) {
    const auto restarts = receiver_->clock().restarts;
    auto points = points_until(device(now_ - kDelay), 10, 2ms);
    for (std::size_t k = 4; k < points.size(); ++k)
      points[k].time = emscon::TrackerClockReading::from(points[k].time.to_device_time() + by);
    const auto from = points_.size();
    push(burst(points), now_);
    expect_only_invalid(from, points_.size());
    EXPECT_TRUE(has_flag(points_[from + 4], SampleFlag::Restarted));
    EXPECT_TRUE(has_flag(points_[from + 4], SampleFlag::GapBefore));
    EXPECT_EQ(receiver_->clock().restarts, restarts + 1);
    receiver_ = std::make_unique<TrackerReceiver>();
    stream_until(now_ + 20s);
  }
}

TEST_F(TrackerTimes, AJumpIsCertainAfterThreePacketsOfOnePoint) {
  stream_until(now_ + 20s);
  const auto from = points_.size();
  for (int k = 0; k < 4; ++k, now_ += 332ms)
    push(burst(std::array{point(device(now_) + 1h)}), now_);
  EXPECT_TRUE(has_flag(points_[from], SampleFlag::PointInvalid));
  EXPECT_TRUE(has_flag(points_[from + 1], SampleFlag::PointInvalid));
  EXPECT_FALSE(has_flag(points_[from + 2], SampleFlag::PointInvalid));
  EXPECT_TRUE(has_flag(points_[from + 2], SampleFlag::Restarted));
  EXPECT_FALSE(has_flag(points_[from + 3], SampleFlag::PointInvalid));
}

// --- connections ---------------------------------------------------------------------------------

TEST_F(TrackerReceiverTest, ANewConnectionIsMarkedOnItsFirstPoint) {
  begin_connection();
  packet_at(now_, 3);
  ASSERT_EQ(points_.size(), 3u);
  EXPECT_TRUE(has_flag(points_[0], SampleFlag::Restarted));
  EXPECT_FALSE(has_flag(points_[1], SampleFlag::Restarted));
}

TEST_F(TrackerReceiverTest, PointsOfAnEarlierClientAreNotTaken) {
  push({}, now_);
  packet_at(now_, 3);
  EXPECT_TRUE(points_.empty());
  EXPECT_EQ(receiver_->counters().points_refused, 3u);
  push(tests::tracker::ok(emscon::Command::StartMeasurement), now_);
  packet_at(now_ + 332ms, 3);
  EXPECT_EQ(points_.size(), 3u);
}

TEST_F(TrackerReceiverTest, ARefusedStartOpensNothing) {
  push({}, now_);
  push(tests::tracker::packet(emscon::Answer{emscon::Acknowledge{
           emscon::Command::StartMeasurement, emscon::Status::MeasurementNotReady}}),
       now_);
  packet_at(now_, 3);
  EXPECT_TRUE(points_.empty());
}

TEST_F(TrackerReceiverTest, TheRestOfABrokenConnectionIsDiscarded) {
  begin_connection();
  const Bytes torn = burst(points_until(device(now_), 5, 2ms));
  push(std::span{torn}.first(100), now_);
  begin_connection();
  packet_at(now_, 2);
  EXPECT_EQ(points_.size(), 2u);
}

TEST_F(TrackerReceiverTest, ARecordingMayBeginInTheMiddleOfAPacket) {
  Bytes bytes = burst(points_until(device(now_), 5, 2ms));
  bytes.erase(bytes.begin(), bytes.begin() + 61);
  push(bytes, now_);
  packet_at(now_ + 332ms, 4);
  EXPECT_EQ(points_.size(), 4u);
  EXPECT_TRUE(malformed_.empty());
}

TEST_F(TrackerReceiverTest, AGapInARecordingIsMarkedAndSkipped) {
  begin_connection();
  packet_at(now_, 3);
  const Bytes cut = burst(points_until(device(now_ + 300ms), 5, 2ms));
  push(std::span{cut}.first(90), now_ + 300ms);
  receiver_->bytes_lost();
  push(std::span{cut}.subspan(130), now_ + 600ms);
  packet_at(now_ + 900ms, 3);
  ASSERT_EQ(points_.size(), 6u);
  EXPECT_TRUE(has_flag(points_[3], SampleFlag::GapBefore));
}

TEST_F(TrackerReceiverTest, MalformedBytesAreReportedOnceWithTheFirstBytes) {
  begin_connection();
  const std::string page = "HTTP/1.1 400 Bad Request\r\n\r\n";
  push(std::as_bytes(std::span{page}), now_);
  push(std::as_bytes(std::span{page}), now_);
  ASSERT_EQ(malformed_.size(), 1u);
  EXPECT_EQ(malformed_[0].length, 24u);
  EXPECT_EQ(malformed_[0].first_bytes[0], std::byte{'H'});
  EXPECT_FALSE(malformed_[0].error);
}

TEST_F(TrackerReceiverTest, AnUndecodablePacketIsReportedWithItsReason) {
  begin_connection();
  Bytes bytes = burst(points_until(device(now_), 2, 2ms));
  bytes[12] = std::byte{7};
  push(bytes, now_);
  ASSERT_EQ(malformed_.size(), 1u);
  EXPECT_EQ(malformed_[0].error, emscon::DecodeError::CountMismatch);
}

// --- weather and stationary ----------------------------------------------------------------------

TEST_F(TrackerReceiverTest, WeatherIsSiAndComesOnlyWhenItChanges) {
  emscon::MultiHead head;
  head.environment = {21.5, 990.0, 40.0};
  packet_at(now_, 2, head);
  packet_at(now_ + 332ms, 2, head);
  ASSERT_EQ(weather_.size(), 1u);
  EXPECT_DOUBLE_EQ(weather_[0].air_temperature_K, 294.65);
  EXPECT_DOUBLE_EQ(weather_[0].air_pressure_Pa, 99'000.0);
  EXPECT_DOUBLE_EQ(weather_[0].relative_humidity, 0.4);
  head.environment.temperature = 21.6;
  packet_at(now_ + 664ms, 2, head);
  EXPECT_EQ(weather_.size(), 2u);
  EXPECT_EQ(weather_[1].head.time, points_[4].head.time);
}

TEST_F(TrackerReceiverTest, WeatherThatDoesNotChangeIsRepeatedEveryTenSeconds) {
  emscon::MultiHead head;
  head.environment = {21.5, 990.0, 40.0};
  for (int i = 0; i <= 24; ++i) packet_at(now_ + i * 1s, 2, head);
  EXPECT_EQ(weather_.size(), 3u);
  EXPECT_EQ(weather_.back().air_pressure_Pa, 99'000.0);
  now_ += 25s;
  begin_connection();
  packet_at(now_ + 1s, 2, head);
  EXPECT_EQ(weather_.size(), 4u);
}

TEST_F(TrackerReceiverTest, AStationaryResultIsTimedByItsMiddle) {
  emscon::SingleResult single;
  single.value = {100, 200, 300};
  push(tests::tracker::packet(single), now_);
  ASSERT_EQ(points_.size(), 1u);
  EXPECT_DOUBLE_EQ(points_[0].p_tracker_m[2], 0.3);
  EXPECT_EQ(points_[0].head.time,
            now_ - 251ms);  // half of 500 ms, and half of the delay's bound of 2 ms
  EXPECT_GT(points_[0].head.u_time, 144ms);  // 500 ms / sqrt(12)
  EXPECT_LT(points_[0].head.u_time, 145ms);
  EXPECT_EQ(weather_.size(), 1u);
}

TEST_F(TrackerReceiverTest, AnswersErrorsAndEventsArePassedOn) {
  push({}, now_);
  push(tests::tracker::ok(emscon::Command::SetUnits), now_);
  push(tests::tracker::packet(emscon::StatusChange{emscon::Event::LaserWarmedUp}), now_);
  push(tests::tracker::packet(emscon::ErrorResponse{}), now_);
  EXPECT_EQ(others_, 3);
}

}  // namespace
}  // namespace abbe::drivers
