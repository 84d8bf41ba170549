#include "abbe/dds/publisher_pin.hpp"

#include <gtest/gtest.h>

namespace abbe::dds {
namespace {

using namespace std::chrono_literals;
using Verdict = PublisherPin::Verdict;

constexpr ParticipantId kFirst{1}, kSecond{2}, kThird{3};

/// Participants that send every 10 ms, as abbe does.
struct PublisherPinTest : testing::Test {
  PublisherPin pin;
  PublisherPin::Instant now{1000s};

  /// The verdict on the last sample of the last one.
  Verdict send(std::initializer_list<ParticipantId> who, std::chrono::milliseconds duration) {
    Verdict last{};
    for (const auto end = now + duration; now < end; now += 10ms)
      for (const auto& id : who) last = pin.heard(id, now);
    return last;
  }
};

TEST_F(PublisherPinTest, TheFirstPublisherIsPinned) {
  EXPECT_EQ(pin.heard(kFirst, now), Verdict::NewlyPinned);
  EXPECT_EQ(pin.heard(kFirst, now + 10ms), Verdict::Pinned);
  EXPECT_EQ(pin.pinned(), kFirst);
}

TEST_F(PublisherPinTest, ASecondPublisherBesideItIsIgnored) {
  send({kFirst}, 500ms);
  EXPECT_EQ(send({kFirst, kSecond}, 90ms), Verdict::Waiting);
  EXPECT_EQ(send({kFirst, kSecond}, 60s), Verdict::Foreign);
  EXPECT_EQ(pin.pinned(), kFirst);
}

TEST_F(PublisherPinTest, ASuccessorIsPinnedOnceTheFirstWasSilentFor300Ms) {
  send({kFirst}, 500ms);
  const auto last = now - 10ms;
  now += 190ms;
  EXPECT_EQ(send({kSecond}, 90ms), Verdict::Waiting);
  EXPECT_LT(now - last, PublisherPin::kSilence);
  send({kSecond}, 20ms);
  EXPECT_EQ(pin.pinned(), kSecond);
  EXPECT_FALSE(pin.remembers(kFirst));
}

TEST_F(PublisherPinTest, AnIgnoredPublisherIsNotTheSuccessorOfAFirstThatRestarts) {
  send({kFirst}, 500ms);
  send({kFirst, kSecond}, 1s);
  EXPECT_EQ(send({kSecond}, 400ms), Verdict::Foreign);
  send({kSecond, kThird}, 50ms);
  EXPECT_EQ(pin.pinned(), kThird);
  EXPECT_EQ(send({kThird, kSecond}, 20s), Verdict::Foreign);
}

TEST_F(PublisherPinTest, AnIgnoredPublisherIsAcceptedAfterTenSecondsOfSilence) {
  send({kFirst, kSecond}, 1s);
  EXPECT_EQ(send({kSecond}, 9900ms), Verdict::Foreign);
  send({kSecond}, 100ms);
  EXPECT_EQ(pin.pinned(), kSecond);
}

/// The subscriber was stopped: the time before its first sample is no silence of the publisher.
TEST_F(PublisherPinTest, ASubscriberThatWasPausedKeepsTheFirstPublisher) {
  send({kFirst}, 500ms);
  send({kFirst, kSecond}, 50ms);
  now += 5s;
  EXPECT_EQ(pin.heard(kSecond, now), Verdict::Waiting);
  send({kSecond, kFirst}, 1s);
  EXPECT_EQ(pin.pinned(), kFirst);
}

TEST_F(PublisherPinTest, RemembersEightParticipants) {
  send({kFirst}, 10ms);
  for (std::uint8_t i = 2; i < 100; ++i) send({kFirst, ParticipantId{i}}, 10ms);
  EXPECT_TRUE(pin.remembers(kFirst));
  EXPECT_FALSE(pin.remembers(kSecond));
  EXPECT_TRUE(pin.remembers(ParticipantId{99}));
  EXPECT_FALSE(pin.remembers(ParticipantId{92}));
  EXPECT_TRUE(pin.remembers(ParticipantId{93}));
}

TEST(ParticipantIdText, IsHexadecimalInThreeGroups) {
  EXPECT_EQ(text_of({0x01, 0x0f, 0x4e, 0x2a, 0x8c, 0x1f, 0x01, 0, 0, 0, 0, 0xff}),
            "010f4e2a.8c1f0100.000000ff");
}

}  // namespace
}  // namespace abbe::dds
