#include <gmock/gmock.h>

#include <string>

#include "abbe/config/config.hpp"
#include "abbe/devices/counter_card_options.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kMachine = to_toml(config_tables::mill());

std::string card(const std::string& axes, const std::string& more = {}) {
  return kMachine +
         "[counter_card]\ntransport = \"usbip\"\nhost = \"127.0.0.1\"\nport = 3241\nclock_MHz = "
         "12\n" +
         more + "axes = [" + axes + "]\n";
}

std::vector<std::string> faults_of(const std::string& text) {
  const auto config = parse_config(text, "abbed.toml");
  return config ? std::vector<std::string>{} : config.error().details;
}

const std::string kAxes =
    R"({axis = "X", channel = 0, step_nm = 10}, {axis = "Y", channel = 1, step_nm = 10},
                             {axis = "Z", channel = 2, step_nm = 10})";

TEST(CounterCardConfig, ReadsItsWiringInSi) {
  const auto config = parse_config(
      card(
          R"({axis = "Z", channel = 2, step_nm = 20, invert = true}, {axis = "Y", channel = 1, step_nm = 10},
              {axis = "X", channel = 0, step_nm = 10, offset_mm = -300})",
          "serial_number = \"01ABBE08\"\nlatch_channel = 6\nclock_source = \"timer0\"\nwidth_bits "
          "= 48\n"),
      "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  const auto& found = config->of<CounterCardConfig>()->card;
  EXPECT_EQ(found.port, 3241);
  EXPECT_EQ(found.serial_number, "01ABBE08");
  EXPECT_DOUBLE_EQ(found.wiring.axes.at(0).scale, 10e-9);
  EXPECT_DOUBLE_EQ(found.wiring.axes.at(0).offset, -0.3);
  EXPECT_DOUBLE_EQ(found.wiring.axes.at(2).scale, -20e-9);
  EXPECT_THAT(config->connected_axes(), ElementsAre("X", "Y", "Z"))
      << "whatever their order in the file";
  EXPECT_DOUBLE_EQ(found.wiring.clock_hz, 12e6);
  EXPECT_EQ(found.wiring.clock_source, drivers::ClockSource::Timer0);
  EXPECT_EQ(found.wiring.latch_channel, 6);
  EXPECT_EQ(found.wiring.width, drivers::quad08::CountWidth::Bits48);
}

TEST(CounterCardConfig, StretchesTimeOutsWithTheSpeedOfTheSimulation) {
  const auto config = parse_config(card(kAxes), "abbed.toml");
  ASSERT_TRUE(config);
  const auto real = device_options(*config->of<CounterCardConfig>(), 1.0).session.silence;
  EXPECT_GT(real, std::chrono::milliseconds{0});
  const auto stretched = device_options(*config->of<CounterCardConfig>(), 10.0).session;
  EXPECT_EQ(stretched.open_timeout,
            10 * device_options(*config->of<CounterCardConfig>(), 1.0).session.open_timeout);
  // The operating system may stop the simulator for a second of its clock.
  EXPECT_LT(real, std::chrono::seconds{1});
  EXPECT_EQ(stretched.silence, std::chrono::seconds{10});
}

TEST(CounterCardConfig, RefusesAnAxisScaleOfZero) {
  EXPECT_THAT(faults_of(card(R"({axis = "X", channel = 0, step_nm = 0})")),
              Contains(HasSubstr("axis X (channel 0): scale 0 per count")));
}

TEST(CounterCardConfig, RefusesAStepThatNoScaleHas) {
  EXPECT_THAT(faults_of(card(R"({axis = "X", channel = 0, step_nm = 1e7})")),
              Contains(HasSubstr("counter_card.axes[0].step_nm: one count is 10 mm")));
}

TEST(CounterCardConfig, RefusesTwoChannelsForOneAxis) {
  EXPECT_THAT(
      faults_of(card(
          R"({axis = "X", channel = 0, step_nm = 10}, {axis = "X", channel = 1, step_nm = 10})")),
      Contains(HasSubstr("two channels claim axis X")));
}

TEST(CounterCardConfig, NeedsEveryLinearAxis) {
  EXPECT_THAT(
      faults_of(card(
          R"({axis = "X", channel = 0, step_nm = 10}, {axis = "Z", channel = 2, step_nm = 10})")),
      Contains(HasSubstr("axis Y has no channel")));
}

TEST(CounterCardConfig, WiringIsPartOfTheMachineHash) {
  const auto hash = [](const std::string& x) {
    const auto config =
        parse_config(card("{axis = \"X\", " + x + R"(}, {axis = "Y", channel = 1, step_nm = 10},
                                     {axis = "Z", channel = 2, step_nm = 10})"),
                     "abbed.toml");
    EXPECT_TRUE(config) << config.error().details.front();
    return config ? machine_hash(*config) : "";
  };
  const auto plain = hash("channel = 0, step_nm = 10");
  EXPECT_EQ(plain, hash("channel = 0, step_nm = 10, debounce_code = 3"));
  EXPECT_NE(plain, hash("channel = 3, step_nm = 10"));
  EXPECT_NE(plain, hash("channel = 0, step_nm = 20"));
  EXPECT_NE(plain, hash("channel = 0, step_nm = 10, offset_mm = 1"));
}

TEST(CounterCardConfig, RefusesTwoUsesOfOneChannel) {
  EXPECT_THAT(faults_of(card(R"({axis = "X", channel = 5, step_nm = 10})")),
              Contains(HasSubstr("channel 5 is claimed by axis X and the clock")));
}

TEST(CounterCardConfig, RefusesAnAxisTheMachineDoesNotHave) {
  EXPECT_THAT(faults_of(card(R"({axis = "B", channel = 0, step_nm = 10})")),
              Contains(HasSubstr("no such axis in [axes]")));
}

TEST(CounterCardConfig, RefusesAxesFromTwoDevices) {
  const auto text = card(kAxes) +
                    "[encoder]\ntransport = \"socketcan\"\ninterface = \"can0\"\nnodes = [{axis = "
                    "\"X\", node = 1}]\n";
  EXPECT_THAT(faults_of(text),
              Contains(HasSubstr("axis X is claimed by [encoder] and [counter_card]")));
}

TEST(CounterCardConfig, RefusesKeysOfTheOtherTransport) {
  const auto text =
      kMachine +
      "[counter_card]\ntransport = \"usb\"\nport = 3240\naxes = [{axis = \"X\", channel = 0, "
      "step_nm = 10}]\n";
  EXPECT_THAT(faults_of(text), Contains(HasSubstr("has no meaning with transport = \"usb\"")));
}

}  // namespace
}  // namespace abbe::daemon
