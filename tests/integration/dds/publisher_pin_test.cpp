#include "abbe/subscriber/publisher_pin.hpp"

#include <gtest/gtest.h>

namespace abbe::dds {
namespace {

using namespace std::chrono_literals;
using Verdict = PublisherPin::Verdict;

constexpr ParticipantId kFirst{1}, kSecond{2}, kThird{3}, kOther{200};

const std::string kMill = "7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11",
                  kOtherMill = "b6f4f9a0-51c5-4b0e-9a53-0a6a0f6b7a22";

/// Participants that send every 10 ms, as abbe does; kOther states another machine than the rest.
struct PublisherPinTest : testing::Test {
  PublisherPin pin;
  PublisherPin::Instant now{1000s};

  static std::string machine_of(const ParticipantId& id) {
    return id == kOther ? kOtherMill : kMill;
  }

  /// The verdict on the last sample of the last one. Each states its machine first.
  Verdict send(std::initializer_list<ParticipantId> who, std::chrono::milliseconds duration) {
    Verdict last{};
    for (const auto& id : who)
      if (!pin.stated_by(id)) last = pin.identified(id, machine_of(id), Twin::None, now);
    for (const auto end = now + duration; now < end; now += 10ms)
      for (const auto& id : who) last = pin.heard(id, now);
    return last;
  }
};

TEST_F(PublisherPinTest, TheFirstPublisherThatStatesItsMachineIsPinned) {
  EXPECT_EQ(pin.heard(kSecond, now), Verdict::Waiting);
  EXPECT_EQ(pin.heard(kFirst, now), Verdict::Waiting);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::None, now), Verdict::NewlyPinned);
  EXPECT_EQ(pin.heard(kFirst, now + 10ms), Verdict::Pinned);
  EXPECT_EQ(pin.pinned(), kFirst);
  EXPECT_EQ(pin.machine_id(), kMill);
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

TEST_F(PublisherPinTest, AnotherMachineOfTheSameNameIsNeverPinned) {
  send({kFirst}, 500ms);
  EXPECT_EQ(send({kFirst, kOther}, 1s), Verdict::OtherMachine);
  EXPECT_EQ(send({kOther}, 1h), Verdict::OtherMachine);
  EXPECT_EQ(pin.pinned(), kFirst);
  send({kSecond}, 50ms);  // the first machine is back
  EXPECT_EQ(pin.pinned(), kSecond);
}

TEST_F(PublisherPinTest, ASubscriberWithAMachineIdPinsThisMachineOnly) {
  pin = PublisherPin(kOtherMill);
  EXPECT_EQ(send({kFirst}, 60s), Verdict::OtherMachine);
  EXPECT_EQ(pin.pinned(), std::nullopt);
  EXPECT_EQ(send({kFirst, kOther}, 1s), Verdict::Pinned);
}

TEST_F(PublisherPinTest, OfTwinsNoneIsPinnedUnlessTheMachineIdIsGiven) {
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::Other, now), Verdict::Ambiguous);
  EXPECT_EQ(pin.identified(kOther, kOtherMill, Twin::Other, now), Verdict::Ambiguous);
  EXPECT_EQ(pin.pinned(), std::nullopt);
  PublisherPin given(kOtherMill);
  EXPECT_EQ(given.identified(kFirst, kMill, Twin::Other, now), Verdict::OtherMachine);
  EXPECT_EQ(given.identified(kOther, kOtherMill, Twin::Other, now), Verdict::NewlyPinned);
}

TEST_F(PublisherPinTest, ATwinThatAppearsLaterDoesNotReleaseTheFirst) {
  send({kFirst}, 500ms);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::Other, now), Verdict::Pinned);
}

TEST_F(PublisherPinTest, AParticipantThatStatesAnotherMachineIsNotUsedAnyMore) {
  send({kFirst}, 500ms);
  EXPECT_EQ(pin.identified(kFirst, kOtherMill, Twin::None, now), Verdict::OtherMachine);
  EXPECT_EQ(pin.heard(kFirst, now + 10s), Verdict::OtherMachine);
  EXPECT_EQ(pin.pinned(), std::nullopt);
}

/// A copied disk: two machines with one identity.
TEST_F(PublisherPinTest, AnIgnoredPublisherIsNotTheSuccessorOfAFirstThatRestarts) {
  send({kFirst}, 500ms);
  send({kFirst, kSecond}, 1s);
  EXPECT_EQ(send({kSecond}, 400ms), Verdict::Foreign);
  send({kSecond, kThird}, 50ms);
  EXPECT_EQ(pin.pinned(), kThird);
  EXPECT_EQ(send({kThird, kSecond}, 20s), Verdict::Foreign);
}

TEST_F(PublisherPinTest, AnIgnoredPublisherIsNotPinnedAfterTheEndOfTheFirst) {
  send({kFirst, kSecond}, 1s);
  EXPECT_EQ(send({kSecond}, 1h), Verdict::Foreign);
  EXPECT_EQ(pin.pinned(), kFirst);
}

/// A copied disk again: nothing shows which of the two is the machine of this subscriber.
TEST_F(PublisherPinTest, OfTwoPublishersWithOneIdentityNoneIsChosen) {
  pin = PublisherPin(kMill);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::SameId, now), Verdict::Copied);
  EXPECT_EQ(pin.heard(kFirst, now + 10s), Verdict::Copied);
  EXPECT_EQ(pin.pinned(), std::nullopt);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::None, now + 20s), Verdict::NewlyPinned);
}

TEST_F(PublisherPinTest, ACopyThatAppearsLaterDoesNotReleaseTheFirst) {
  send({kFirst}, 2s);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::SameId, now), Verdict::Pinned);
}

TEST_F(PublisherPinTest, ARestartedPublisherThatSeesTheForeignCopyIsPinned) {
  send({kFirst, kSecond}, 1s);
  ASSERT_EQ(pin.identified(kSecond, kMill, Twin::SameId, now), Verdict::Foreign);
  (void)pin.identified(kThird, kMill, Twin::SameId, now);
  EXPECT_EQ(send({kThird, kSecond}, 2s), Verdict::Foreign) << "of the copy, which sent last";
  EXPECT_EQ(pin.pinned(), kThird);
}

TEST_F(PublisherPinTest, ACopyThatTheMachineHasNotSeenIsSeenHere) {
  EXPECT_EQ(pin.identified(kFirst, "", Twin::None, now), Verdict::Unidentified);
  EXPECT_EQ(pin.identified(kSecond, kMill, Twin::Other, now), Verdict::Ambiguous);
  EXPECT_EQ(pin.identified(kThird, kMill, Twin::None, now), Verdict::Copied);
  EXPECT_EQ(pin.identified(kThird, kMill, Twin::None, now + 3s), Verdict::NewlyPinned);
}

TEST_F(PublisherPinTest, AnEmptyMachineIdIsNeverPinned) {
  EXPECT_EQ(pin.identified(kFirst, "", Twin::None, now), Verdict::Unidentified);
  EXPECT_EQ(pin.heard(kFirst, now + 1h), Verdict::Unidentified);
  EXPECT_EQ(pin.pinned(), std::nullopt);
  EXPECT_EQ(pin.identified(kSecond, kMill, Twin::None, now + 1h), Verdict::NewlyPinned);
  EXPECT_EQ(pin.identified(kSecond, "", Twin::None, now + 1h), Verdict::Unidentified);
  EXPECT_EQ(pin.pinned(), std::nullopt);
}

TEST_F(PublisherPinTest, AnEarlierVersionWithoutIdentityIsPinnedByItsNameAfterFiveSeconds) {
  const auto start = now;
  const auto hear = [&](const ParticipantId& id, std::chrono::milliseconds at) {
    return pin.heard(id, start + at);
  };
  EXPECT_EQ(hear(kFirst, 0ms), Verdict::Waiting);
  EXPECT_EQ(hear(kFirst, 4900ms), Verdict::Waiting);
  EXPECT_EQ(hear(kFirst, 5000ms), Verdict::NewlyPinned);
  EXPECT_EQ(hear(kFirst, 5010ms), Verdict::Pinned);
  EXPECT_EQ(pin.machine_id(), std::nullopt);
  EXPECT_EQ(pin.identified(kFirst, kMill, Twin::None, start + 6s), Verdict::NewlyPinned);
  EXPECT_EQ(pin.machine_id(), kMill);
}

TEST_F(PublisherPinTest, WithoutIdentityNoneIsPinnedIfAMachineIdWasGivenOrIsStated) {
  PublisherPin given(kMill);
  EXPECT_EQ(given.heard(kFirst, now), Verdict::Waiting);
  EXPECT_EQ(given.heard(kFirst, now + 60s), Verdict::Waiting);
  pin.heard(kFirst, now);
  EXPECT_EQ(pin.identified(kOther, kOtherMill, Twin::Other, now + 5s), Verdict::Ambiguous);
  EXPECT_EQ(pin.heard(kFirst, now + 6s), Verdict::Waiting);
}

TEST_F(PublisherPinTest, ASubscriberOfSlowTopicsAwaitsALongerSilence) {
  pin = PublisherPin({}, PublisherPin::kSilenceOfSlowTopics);
  send({kFirst}, 500ms);
  send({kSecond}, 1400ms);
  EXPECT_EQ(pin.pinned(), kFirst);
  send({kSecond}, 200ms);
  EXPECT_EQ(pin.pinned(), kSecond);
}

TEST(TwinOfIdentity, IsKnownByHowTwinSeenBegins) {
  EXPECT_EQ(twin_of(false, "", "mill"), Twin::None);
  EXPECT_EQ(twin_of(true, "the same name, machine_id 4711, from", "mill"), Twin::Other);
  EXPECT_EQ(twin_of(true, "the same machine_id, as machine mill, from", "mill"), Twin::SameId);
  EXPECT_EQ(twin_of(true, "the same machine_id, as machine mill-b, from", "mill"), Twin::Other);
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
