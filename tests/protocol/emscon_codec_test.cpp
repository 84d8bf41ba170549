#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "emscon_samples.hpp"

namespace abbe::protocol::emscon {
namespace {

using samples::Bytes;
using samples::encoded;

/// A heap copy of exactly these bytes, so that AddressSanitizer sees a read of one byte too many.
struct Exact {
  explicit Exact(std::span<const std::byte> bytes)
      : size(bytes.size()), data(new std::byte[bytes.size()]) {
    std::copy(bytes.begin(), bytes.end(), data.get());
  }
  [[nodiscard]] std::span<const std::byte> view() const { return {data.get(), size}; }
  std::size_t size;
  std::unique_ptr<std::byte[]> data;
};

TEST(EmsconRequest, EveryOneSurvivesTheRoundTrip) {
  ASSERT_EQ(samples::requests().size(), std::variant_size_v<Request>);
  for (const Request& request : samples::requests()) {
    const Bytes bytes = encoded(request);
    const auto decoded = decode_request(bytes);
    ASSERT_TRUE(decoded) << name_of(command_of(request));
    EXPECT_EQ(decoded->index(), request.index());
    EXPECT_EQ(encoded(*decoded), bytes) << name_of(command_of(request));
  }
}

TEST(EmsconRequest, DecodesEveryFieldToItsPlace) {
  const auto decoded =
      decode_request(encoded(Request{SetContinuousTimeModeParams{2, 1000, true, RegionType::Box}}));
  ASSERT_TRUE(decoded);
  const auto* params = std::get_if<SetContinuousTimeModeParams>(&*decoded);
  ASSERT_NE(params, nullptr);
  EXPECT_EQ(params->time_separation_ms, 2);
  EXPECT_EQ(params->number_of_points, 1000);
  EXPECT_TRUE(params->use_region);
  EXPECT_EQ(params->region_type, RegionType::Box);
}

TEST(EmsconController, EveryPacketSurvivesTheRoundTrip) {
  for (const Bytes& bytes : samples::controller_packets()) {
    const auto decoded = decode(bytes);
    ASSERT_TRUE(decoded) << name_of(decoded.error());
    if (!std::holds_alternative<OtherPacket>(*decoded)) {
      EXPECT_EQ(samples::encoded_again(*decoded), bytes);
    }
  }
}

TEST(EmsconController, EveryTruncatedPrefixIsRefused) {
  for (const Bytes& bytes : samples::controller_packets()) {
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      EXPECT_FALSE(decode(Exact{std::span{bytes}.first(length)}.view()))
          << length << " of " << bytes.size();
    }
  }
}

TEST(EmsconRequest, EveryTruncatedPrefixIsRefused) {
  for (const Request& request : samples::requests()) {
    const Bytes bytes = encoded(request);
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      EXPECT_FALSE(decode_request(Exact{std::span{bytes}.first(length)}.view()))
          << name_of(command_of(request));
    }
  }
}

/// A size field that agrees with the cut must not make a cut packet whole.
TEST(EmsconController, APacketCutAndRelabelledIsNeverReadPastItsEnd) {
  std::size_t refused = 0;
  for (Bytes bytes : samples::controller_packets()) {
    for (std::size_t length = kHeaderSize; length < bytes.size(); ++length) {
      bytes[0] = static_cast<std::byte>(length & 0xff);
      bytes[1] = static_cast<std::byte>(length >> 8);
      const Exact cut{std::span{bytes}.first(length)};
      const auto decoded = decode(cut.view());
      if (!decoded) {
        ++refused;
      } else {
        EXPECT_LE(samples::encoded_again(*decoded).size(), length);
      }
    }
  }

  EXPECT_GT(refused, 500u);
}

/// Flips every byte; what still decodes must encode to something that decodes to the same again.
TEST(EmsconController, AnyFlippedByteIsRefusedOrDecodesCleanly) {
  std::size_t refused = 0;
  std::size_t decoded_still = 0;
  for (Bytes bytes : samples::controller_packets()) {
    for (std::byte& byte : bytes) {
      byte ^= std::byte{0xff};
      const Exact flipped{bytes};
      const auto decoded = decode(flipped.view());
      ++(decoded ? decoded_still : refused);
      if (decoded) {
        const Bytes once = samples::encoded_again(*decoded);
        if (!once.empty()) {
          EXPECT_EQ(samples::encoded_again(*decode(once)), once);
        }
      }
      byte ^= std::byte{0xff};
    }
  }

  EXPECT_GT(refused, 100u);
  EXPECT_GT(decoded_still, 100u);
}

TEST(EmsconRequest, AnyFlippedByteIsRefusedOrDecodesCleanly) {
  for (const Request& request : samples::requests()) {
    Bytes bytes = encoded(request);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      bytes[i] ^= std::byte{0xff};
      const auto decoded = decode_request(Exact{bytes}.view());
      if (i < kHeaderSize) {
        EXPECT_FALSE(decoded) << name_of(command_of(request)) << " byte " << i;
      }
      if (decoded) {
        EXPECT_EQ(encoded(*decoded).size(), bytes.size());
      }
      bytes[i] ^= std::byte{0xff};
    }
  }
}

TEST(EmsconEncode, WritesNothingIntoATooSmallBuffer) {
  for (const Request& request : samples::requests()) {
    Bytes room(encoded(request).size() - 1);
    EXPECT_EQ(encode(request, room), 0u);
  }
  const auto points = samples::points();
  Bytes room(kMultiHeadSize + points.size() * kMultiPointSize - 1);
  EXPECT_EQ(encode(samples::head(), std::span<const MultiPoint>{points}, room), 0u);
}

TEST(EmsconEncode, RefusesMorePointsThanOnePacketHolds) {
  const std::vector<MultiPoint> points(kMaxMultiPoints + 1);
  Bytes room(2 * kMaxPacketSize);
  EXPECT_EQ(encode(MultiHead{}, std::span<const MultiPoint>{points}, room), 0u);
  EXPECT_NE(encode(MultiHead{}, std::span<const MultiPoint>{points}.first(kMaxMultiPoints), room),
            0u);
}

TEST(EmsconAnswer, AQueryMayBeRefusedWithSixteenBytes) {
  const auto answer =
      decode_answer(encoded(Answer{Acknowledge{Command::GetUnits, Status::ServerBusy}}));
  ASSERT_TRUE(answer);
  EXPECT_TRUE(std::holds_alternative<Acknowledge>(*answer));
  EXPECT_EQ(command_of(*answer), Command::GetUnits);
  EXPECT_EQ(status_of(*answer), Status::ServerBusy);
}

TEST(EmsconAnswer, MayBeLongerThanKnownHere) {
  Bytes bytes = encoded(Answer{TrackerStatusAnswer{Status::Ok, TrackerStatus::Busy}});
  bytes.resize(bytes.size() + 8);
  bytes[0] = static_cast<std::byte>(bytes.size());
  const auto answer = decode_answer(bytes);
  ASSERT_TRUE(answer);
  ASSERT_TRUE(std::holds_alternative<TrackerStatusAnswer>(*answer));
  EXPECT_EQ(std::get<TrackerStatusAnswer>(*answer).tracker, TrackerStatus::Busy);
}

TEST(EmsconMultiResult, RefusesACountThatDoesNotFitTheSize) {
  Bytes bytes = encoded(samples::head(), std::span<const MultiPoint>{samples::points()});
  bytes[12] = std::byte{4};
  EXPECT_EQ(MultiResult::from(bytes).error(), DecodeError::CountMismatch);
  bytes[15] = std::byte{0xff};  // a negative count
  EXPECT_EQ(MultiResult::from(bytes).error(), DecodeError::CountMismatch);
}

TEST(EmsconMultiResult, GivesTheStatisticsOfAnExtendedPoint) {
  const Bytes bytes =
      encoded(samples::head(), std::span<const ExtendedMultiPoint>{samples::extended_points()});
  const auto result = MultiResult::from(bytes);
  ASSERT_TRUE(result);
  ASSERT_TRUE(result->extended());
  EXPECT_EQ(result->statistics(1).apriori_total, 0.14);
  EXPECT_EQ(result->point(1).value[0], 1001.0);
}

TEST(EmsconStatus, OddOutOfRangeWarningsAreAccepted) {
  EXPECT_TRUE(accepted(Status::Ok));
  EXPECT_TRUE(accepted(Status::Parameter1OutOfRangeOk));
  EXPECT_TRUE(accepted(static_cast<Status>(21)));
  EXPECT_FALSE(accepted(Status::Parameter1OutOfRangeNok));
  EXPECT_FALSE(accepted(static_cast<Status>(23)));
  EXPECT_FALSE(accepted(Status::ServerBusy));
}

TEST(EmsconClock, ReadingSurvivesTheRoundTripToTheMicrosecond) {
  const DeviceTime t{std::chrono::nanoseconds{-1'500'000'700}};
  const auto reading = TrackerClockReading::from(t);
  EXPECT_EQ(reading.seconds, -2);
  EXPECT_EQ(reading.microseconds, 499'999);
  EXPECT_EQ(reading.to_device_time(), DeviceTime{std::chrono::nanoseconds{-1'500'001'000}});
}

}  // namespace
}  // namespace abbe::protocol::emscon
