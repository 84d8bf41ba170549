/// [probe], [cmm] and [dds] of a configuration.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "abbe/config/config.hpp"
#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kCardWithProbe = R"([counter_card]
transport = "usbip"
latch_channel = 6
edge_channel = 7
axes = [{axis = "X", channel = 0, step_nm = 10}, {axis = "Y", channel = 1, step_nm = 10},
        {axis = "Z", channel = 2, step_nm = 10}]
)";

TEST(ConfigProbe, IsReadInSi) {
  const auto config = parse_config(kMachine + kCardWithProbe +
                                       "[probe]\nid = 4\ndelay_us = 2000\njitter_us = 20\n" +
                                       "max_speed_mm_s = 8\nconfirm_ms = 4\n",
                                   "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  ASSERT_TRUE(config->of<ProbeConfig>());
  EXPECT_EQ(config->of<ProbeConfig>()->delay.id, 4u);
  EXPECT_EQ(config->of<ProbeConfig>()->delay.delay, std::chrono::milliseconds{2});
  EXPECT_EQ(config->of<ProbeConfig>()->approach.max_speed_m_s, 0.008);
  EXPECT_EQ(config->of<ProbeConfig>()->switching.confirm, std::chrono::milliseconds{4});
}

TEST(ConfigProbe, NeedsChannelsOfACounterCard) {
  EXPECT_THAT(faults_of(kMachine + "[probe]\nid = 4\n"),
              ElementsAre(HasSubstr("needs [counter_card]")));
}

TEST(ConfigProbe, RefusesImpossibleProbeValues) {
  EXPECT_THAT(faults_of(kMachine + kCardWithProbe + "[probe]\nconfirm_ms = 1\nchatter_ms = 2\n"),
              ElementsAre(HasSubstr("the chatter time must be below the confirmation")));
}

TEST(ConfigCmm, IsReadInSi) {
  const auto config = parse_config(
      kMachine + "[cmm]\nhost = \"10.0.0.9\"\ntool = \"ruby 4\"\nu_position_um = 0.9\n",
      "abbed.toml");
  ASSERT_TRUE(config && config->of<CmmConfig>());
  EXPECT_EQ(config->of<CmmConfig>()->host, "10.0.0.9");
  EXPECT_EQ(config->of<CmmConfig>()->port, 1294);
  EXPECT_DOUBLE_EQ(config->of<CmmConfig>()->u_position_m, 0.9e-6);
  EXPECT_FALSE(config->of<CmmConfig>()->home);
}

// A longer time would outlast systemd's TimeoutStopSec: abbed waits for AbortE at its end.
TEST(ConfigCmm, BoundsItsTimeOuts) {
  const std::string cmm = kMachine + "[cmm]\nhost = \"10.0.0.9\"\n";
  EXPECT_TRUE(parse_config(cmm + "command_timeout_s = 5\nmotion_timeout_s = 3600\n", "abbed.toml"));
  EXPECT_THAT(faults_of(cmm + "command_timeout_s = 5.1\n"),
              ElementsAre(HasSubstr("cmm.command_timeout_s")));
  EXPECT_THAT(faults_of(cmm + "motion_timeout_s = 1e9\n"),
              ElementsAre(HasSubstr("cmm.motion_timeout_s")));
}

TEST(ConfigDds, RunsAbbeDdsAsAUnitUnderSystemd) {
  auto unit = parse_config(kMachine, "abbed.toml");
  ASSERT_TRUE(unit);
  auto child = *unit;
  use_dds_unit(unit->dds, unit->daemon.runtime_dir, true);
  use_dds_unit(child.dds, child.daemon.runtime_dir, false);
  EXPECT_EQ(unit->dds.supervise, Supervise::Systemd);
  EXPECT_EQ(unit->dds.socket, "/run/abbe-dds/dds.sock");
  EXPECT_EQ(child.dds.supervise, Supervise::Child);
  EXPECT_EQ(child.dds.socket, "/run/abbe/dds.sock");
}

TEST(ConfigDds, AnExplicitChoiceStays) {
  auto config = parse_config(
      kMachine + "[dds]\nsupervise = \"child\"\nsocket = \"/run/x/dds.sock\"\n", "abbed.toml");
  ASSERT_TRUE(config);
  use_dds_unit(config->dds, config->daemon.runtime_dir, true);
  EXPECT_EQ(config->dds.supervise, Supervise::Child);
  EXPECT_EQ(config->dds.socket, "/run/x/dds.sock");
}

TEST(ConfigCmm, NeedsAHost) {
  EXPECT_THAT(faults_of(kMachine + "[cmm]\nport = 1294\n"), ElementsAre(HasSubstr("cmm.host")));
}

}  // namespace
}  // namespace abbe::daemon
