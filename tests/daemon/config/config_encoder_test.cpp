// [encoder]: nodes, SYNC and transport.

#include <gmock/gmock.h>

#include <string>

#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(ConfigEncoder, PutsTheNodesInTheOrderOfTheMachinesAxes) {
  const auto config = parse_config(kMachine + kCanBus + R"(nodes = [
  {axis = "B", node = 9, step_nrad = 1000}, {axis = "Z", node = 3}, {axis = "W", node = 4}, {axis = "X", node = 1}, {axis = "Y", node = 2}]
[axes.B]
kind = "rotary"
min_rad = 2
max_rad = 3
[axes.W]
min_mm = 0
max_mm = 100
)",
                                   "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  std::string order;
  for (const auto& node : config->of<EncoderConfig>()->nodes)
    order += node.axis + std::to_string(node.node);
  EXPECT_EQ(order, "X1Y2Z3W4B9");
  EXPECT_EQ(config->of<EncoderConfig>()->nodes.back().middle, 2.5);
}

TEST(ConfigEncoder, NeedsTheStepOfARotaryAxis) {
  EXPECT_THAT(faults_of(kMachine + kCanBus + R"(nodes = [
  {axis = "X", node = 1}, {axis = "Y", node = 2}, {axis = "Z", node = 3}, {axis = "B", node = 4}]
[axes.B]
kind = "rotary"
min_rad = -1
max_rad = 1
)"),
              ElementsAre(HasSubstr("encoder.nodes[3].step_nrad: missing")));
}

TEST(ConfigEncoder, RefusesAnEncoderWithoutXyz) {
  EXPECT_THAT(
      faults_of(kMachine + kCanBus + R"(nodes = [{axis = "X", node = 5}, {axis = "Z", node = 6}])"),
      ElementsAre(HasSubstr("encoder.nodes: axis Y has no node")));
}

TEST(ConfigEncoder, RefusesTwoNodesOnOneId) {
  EXPECT_THAT(
      faults_of(kMachine + kCanBus +
                R"(nodes = [{axis = "X", node = 5}, {axis = "Y", node = 5}, {axis = "Z", node = 6}]
)"),
      ElementsAre(HasSubstr("encoder.nodes[1].node: node id 5 is used twice")));
}

TEST(ConfigEncoder, RefusesStepsThatNoScaleHas) {
  EXPECT_THAT(faults_of(kMachine + kCanBus + R"(nodes = [
  {axis = "X", node = 1, step_nm = 1e7}, {axis = "Y", node = 2, step_nm = 1e6},
  {axis = "Z", node = 3}, {axis = "B", node = 4, step_nrad = 2e8}]
[axes.B]
kind = "rotary"
min_rad = -1
max_rad = 1
)"),
              ElementsAre(AllOf(HasSubstr("encoder.nodes[0].step_nm: one count is 10 mm"),
                                HasSubstr("at most 1 mm")),
                          AllOf(HasSubstr("encoder.nodes[3].step_nrad: one count is 0.2 rad"),
                                HasSubstr("at most 0.1 rad"))));
}

TEST(ConfigEncoder, LetsTheKernelSendTheSyncOnSocketCanOnly) {
  const std::string by_kernel = "sync = \"kernel\"\n" + kNodes;
  const auto config = parse_config(kMachine + kCanBus + by_kernel, "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->of<EncoderConfig>()->sync, SyncConfig::Kernel);
  const std::string udp =
      "[encoder]\ntransport = \"udp\"\npeer_host = \"10.0.0.8\"\npeer_port = 20000\n";
  EXPECT_THAT(faults_of(kMachine + udp + by_kernel), ElementsAre(HasSubstr("encoder.sync")));
}

TEST(ConfigEncoder, RefusesAnIPv6PeerOfCanOverUdp) {
  const std::string udp =
      "[encoder]\ntransport = \"udp\"\npeer_host = \"::1\"\npeer_port = 20000\n";
  EXPECT_THAT(faults_of(kMachine + udp + kNodes),
              ElementsAre(HasSubstr("encoder.peer_host: is an IPv6 address")));
}

TEST(ConfigEncoder, TakesTheMachinesOwnSyncOnEitherTransport) {
  const std::string external = "sync = \"external\"\n";
  const auto config = parse_config(
      kMachine + kCanBus + external +
          R"(nodes = [{axis = "X", node = 1, tpdo = 2, position_byte = 2}, {axis = "Y", node = 2}, {axis = "Z", node = 3}]
)",
      "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->of<EncoderConfig>()->sync, SyncConfig::External);
  EXPECT_EQ(config->of<EncoderConfig>()->nodes[0].tpdo, 2);
  EXPECT_EQ(config->of<EncoderConfig>()->nodes[0].position_byte, 2);
  const std::string udp =
      "[encoder]\ntransport = \"udp\"\npeer_host = \"10.0.0.8\"\npeer_port = 20000\n";
  EXPECT_THAT(faults_of(kMachine + udp + external + kNodes),
              ElementsAre(AllOf(HasSubstr("encoder.local_port"), HasSubstr("sends nothing"))));
  EXPECT_THAT(faults_of(kMachine + udp + "local_port = 20000\n" + external + kNodes), SizeIs(0));
}

TEST(ConfigEncoder, RefusesAPositionByteUnlessTheSyncIsExternal) {
  EXPECT_THAT(
      faults_of(
          kMachine + kCanBus +
          R"(nodes = [{axis = "X", node = 1, position_byte = 2}, {axis = "Y", node = 2}, {axis = "Z", node = 3}]
)"),
      ElementsAre(AllOf(HasSubstr("position_byte"), HasSubstr("external"))));
}

TEST(ConfigEncoder, RefusesKeysOfTheOtherTransport) {
  EXPECT_THAT(faults_of(kMachine + kCanBus + "peer_port = 9\n" + kNodes),
              ElementsAre(HasSubstr("encoder.peer_port: has no meaning")));
}

}  // namespace
}  // namespace abbe::daemon
