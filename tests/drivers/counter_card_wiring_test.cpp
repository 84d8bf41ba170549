#include <gtest/gtest.h>

#include "abbe/drivers/counter_card/device.hpp"
#include "counter_card_peer.hpp"

namespace abbe::drivers {
namespace {

using testing::HasSubstr;

std::string refusal(const CounterCardWiring& wiring) {
  const auto checked = check(wiring);
  return checked ? "" : checked.error().text;
}

TEST(CounterCardWiring, OfTheTestsIsValid) {
  EXPECT_EQ(refusal(tests::card_wiring()), "");
}

TEST(CounterCardWiring, RefusesAScaleOfZeroByName) {
  auto wiring = tests::card_wiring();
  wiring.axes[1].scale = 0.0;
  EXPECT_THAT(refusal(wiring), HasSubstr("axis Y (channel 1): scale 0"));
}

TEST(CounterCardWiring, RefusesTwoChannelsForOneAxis) {
  auto wiring = tests::card_wiring();
  wiring.axes[1].name = "X";
  EXPECT_THAT(refusal(wiring), HasSubstr("two channels claim axis X"));
}

TEST(CounterCardWiring, RefusesTwoUsesOfOneChannel) {
  auto wiring = tests::card_wiring();
  wiring.axes[1].channel = 6;
  EXPECT_THAT(refusal(wiring), HasSubstr("channel 6 is claimed by axis Y and the probe latch"));
  wiring.axes[1].channel = 8;
  EXPECT_THAT(refusal(wiring), HasSubstr("channel 8, 0 to 7 exist"));
}

TEST(CounterCardWiring, RefusesAClockTooSlowToSeeLostScans) {
  auto wiring = tests::card_wiring();
  wiring.clock_hz = 100e3;
  EXPECT_THAT(refusal(wiring), HasSubstr("2.5 clock periods per scan"));
}

TEST(CounterCardWiring, RefusesATimerThatCannotMakeTheClock) {
  auto wiring = tests::card_wiring();
  wiring.clock_source = ClockSource::Timer0;
  wiring.clock_hz = 7e6;
  EXPECT_THAT(refusal(wiring), HasSubstr("timer cannot make 7000000 Hz"));
}

TEST(CounterCardWiring, ReadsTheUsedChannelsInAscendingOrder) {
  const auto layout = layout_of(tests::card_wiring());
  EXPECT_THAT(std::vector(layout.used().begin(), layout.used().end()),
              testing::ElementsAre(0, 1, 5, 6));
}

TEST(CounterCardWiring, NamesItsAssumptions) {
  auto wiring = tests::card_wiring();
  EXPECT_TRUE(rests_on_assumption(wiring));
  wiring.latch_verified = true;
  EXPECT_FALSE(rests_on_assumption(wiring));
  wiring.latch_verified = false;
  wiring.latch_channel.reset();
  EXPECT_FALSE(rests_on_assumption(wiring));
}

TEST(CounterCardWiring, TransfersAreWholePackets) {
  CounterCardOptions options;
  options.receiver.wiring = tests::card_wiring();
  options.transfer_time = std::chrono::milliseconds{1};  // 640 bytes
  EXPECT_EQ(transfer_bytes(options), 1024u);
  options.transfer_time = std::chrono::seconds{1};
  EXPECT_EQ(transfer_bytes(options), 16384u);
}

}  // namespace
}  // namespace abbe::drivers
