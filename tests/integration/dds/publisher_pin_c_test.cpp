// The rule in C gives the verdicts of the rule in C++, for random participants.
#include "abbe/subscriber/publisher_pin.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "abbe/subscriber/publisher_pin.hpp"

namespace abbe::dds {
namespace {

using namespace std::chrono_literals;

/// Both rules hear the same.
class BothPins {
 public:
  BothPins(const std::string& machine_id, std::chrono::milliseconds silence)
      : cpp_(machine_id, silence) {
    EXPECT_TRUE(abbe_pin_init(&c_, machine_id.c_str(), std::chrono::nanoseconds(silence).count()));
  }

  PublisherPin::Verdict heard(const ParticipantId& id, std::chrono::nanoseconds at) {
    return checked(cpp_.heard(id, instant(at)), abbe_pin_heard(&c_, id.data(), at.count()));
  }
  PublisherPin::Verdict identified(const ParticipantId& id, const std::string& machine_id,
                                   Twin twin, std::chrono::nanoseconds at) {
    return checked(cpp_.identified(id, machine_id, twin, instant(at)),
                   abbe_pin_identified(&c_, id.data(), machine_id.c_str(),
                                       static_cast<abbe_pin_twin>(twin), at.count()));
  }
  void expect_same_memory(const ParticipantId& id) const {
    EXPECT_EQ(cpp_.remembers(id), abbe_pin_place_of(&c_, id.data()) >= 0);
    EXPECT_EQ(cpp_.pinned() == id,
              c_.pinned >= 0 && abbe_pin_place_of(&c_, id.data()) == c_.pinned);
    EXPECT_EQ(cpp_.machine_id().value_or("none"), c_.has_machine_id ? c_.machine_id : "none");
  }

 private:
  static PublisherPin::Instant instant(std::chrono::nanoseconds at) {
    return PublisherPin::Instant(at);
  }
  static PublisherPin::Verdict checked(PublisherPin::Verdict cpp, abbe_pin_verdict c) {
    EXPECT_EQ(static_cast<int>(cpp), static_cast<int>(c));
    return cpp;
  }

  PublisherPin cpp_;
  abbe_publisher_pin c_;
};

/// A participant that sends for some time and then is silent for some.
struct Sender {
  std::string machine_id;
  Twin twin = Twin::None;
  bool sends = false;
};

const std::array<std::string, 3> kMachineIds{"7c1d5a52-8f0d-4c0e-8d0d-2f6b3f1f0c11",
                                             "b6f4f9a0-51c5-4b0e-9a53-0a6a0f6b7a22", ""};

TEST(PublisherPinInC, GivesTheVerdictsOfTheRuleInCpp) {
  constexpr int kRounds = 300, kSamples = 1000, kParticipants = 11;
  std::map<PublisherPin::Verdict, int> seen;
  for (int round = 0; round < kRounds && !testing::Test::HasFailure(); ++round) {
    SCOPED_TRACE("seed " + std::to_string(round));
    std::mt19937 random(static_cast<unsigned>(round));
    const auto below = [&](unsigned n) { return static_cast<unsigned>(random() % n); };
    // Few participants are pinned in most rounds; many are forgotten in others.
    const unsigned participants = 1 + below(kParticipants);
    std::vector<Sender> senders(participants);
    for (Sender& s : senders) s = {kMachineIds[below(20) / 9], Twin::None, below(2) == 0};
    BothPins pins(kMachineIds[below(4) == 0 ? below(2) : 2],
                  below(4) == 0 ? PublisherPin::kSilenceOfSlowTopics : PublisherPin::kSilence);
    const bool all_state_identities = below(4) != 0;
    std::chrono::nanoseconds now = 1000s;

    for (int i = 0; i < kSamples && !testing::Test::HasFailure(); ++i) {
      now += std::chrono::microseconds(1 + below(below(20) == 0 ? 1'000'000 : 10'000));
      const unsigned who = below(participants);
      Sender& sender = senders[who];
      const ParticipantId id{static_cast<std::uint8_t>(who)};
      if (below(40) == 0) sender.sends = !sender.sends;
      if (below(200) == 0) sender.machine_id = kMachineIds[below(20) / 9];
      if (below(100) == 0) sender.twin = static_cast<Twin>(below(3));
      if (!sender.sends) continue;
      const bool states = below(10) == 0 && (all_state_identities || who == 0);
      ++seen[states ? pins.identified(id, sender.machine_id, sender.twin, now)
                    : pins.heard(id, now)];
      for (unsigned other = 0; other < participants; ++other)
        pins.expect_same_memory(ParticipantId{static_cast<std::uint8_t>(other)});
    }
  }
  EXPECT_EQ(seen.size(), 8u) << "a verdict that no round gives";
  for (const auto& [verdict, count] : seen)
    EXPECT_GT(count, 100) << "verdict " << static_cast<int>(verdict);
}

TEST(PublisherPinInC, ReadsTwinSeenLikeTheRuleInCpp) {
  for (const char* seen :
       {"", "the same name, machine_id 4711, from", "the same machine_id, as",
        "the same machine_id, as machine mill, from",
        "the same machine_id, as machine mill-b, from", "the same machine_id, as machine mill"}) {
    for (const bool twin : {false, true})
      EXPECT_EQ(static_cast<int>(twin_of(twin, seen, "mill")),
                static_cast<int>(abbe_pin_twin_of(twin, seen, "mill")))
          << seen;
  }
}

TEST(PublisherPinInC, RefusesWhatIsLongerThanAMachineId) {
  abbe_publisher_pin pin;
  EXPECT_FALSE(abbe_pin_init(&pin, (kMachineIds[0] + "x").c_str(), abbe_pin_silence_ns));
  const ParticipantId id{1};
  EXPECT_EQ(abbe_pin_identified(&pin, id.data(), kMachineIds[0].c_str(), ABBE_PIN_TWIN_NONE, 1),
            ABBE_PIN_OTHER_MACHINE);
  EXPECT_EQ(abbe_pin_identified(&pin, id.data(), "", ABBE_PIN_TWIN_NONE, 2), ABBE_PIN_UNIDENTIFIED);
}

}  // namespace
}  // namespace abbe::dds
