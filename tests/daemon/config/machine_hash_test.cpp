// The hash of model files of earlier versions must not change, or no such model can be accepted any
// more. The values are those of earlier versions. Of the present hash: meaning_keys_test.cpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>

#include "abbe/config/config.hpp"
#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using ::testing::SizeIs;

const std::string kMill = R"([machine]
name = "mill"
chain = "[w X' b Y Z (C1) t]"
[axes.X]
min_mm = -300
max_mm = 300
[axes.Y]
min_mm = -250
max_mm = 250
[axes.Z]
min_mm = -400
max_mm = -100
[target]
offset_mm = [20, -15, -120]
[model]
node_spacing_mm = 50
)";

std::string former_hash_with(const std::string& devices) {
  const auto config = parse_config(kMill + devices, "abbed.toml");
  EXPECT_TRUE(config) << ::testing::PrintToString(config.error().details);
  return config ? former_machine_hash(*config) : "";
}

TEST(FormerMachineHash, WithEncodersStays) {
  EXPECT_EQ(former_hash_with(R"([encoder]
transport = "socketcan"
interface = "can0"
nodes = [
  { axis = "X", node = 1, step_nm = 10 },
  { axis = "Y", node = 2, step_nm = 10, offset_mm = 1.5 },
  { axis = "Z", node = 3, step_nm = 10, invert = true },
]
)"),
            "f43f8407c6be8a957ec6dd0c0857fec1ba461f6863b708fbe95e20ceb89b56fe");
}

TEST(FormerMachineHash, WithACardAndReferenceMarksStays) {
  EXPECT_EQ(former_hash_with(R"([counter_card]
transport = "usb"
serial_number = "01ABBE08"
axes_compensated = true
axes = [
  { axis = "X", channel = 0, step_nm = 10 },
  { axis = "Y", channel = 1, step_nm = 10 },
  { axis = "Z", channel = 2, step_nm = 10, invert = true, offset_mm = 3 },
]
[reference]
transport = "usb"
serial_number = "01ABBE09"
axes = [{ axis = "X", channel = 0, signal_period_um = 20, increment = 1000, length_mm = 620 }]
)"),
            "f7aa146602ef8cd9d090f464b1defb85c845803c039bd69d35feb35a192ad323");
}

TEST(FormerMachineHash, WithAMeasuringMachineAndAThermometerStays) {
  EXPECT_EQ(former_hash_with(R"([cmm]
host = "10.0.0.9"
axes_compensated = false
[[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
serial = "/dev/ttyUSB0"
inputs = ["scale_x"]
[[thermal]]
axis = "X"
temperature = "scale_x"
alpha_um_per_m_K = 8
u_alpha_um_per_m_K = 0.5
u_temperature_K = 0.2
fixed_mm = -300
)"),
            "be07aafbfa3d0fb94615b92fea982d1c40870ebbff8166ad6e25ccee2b07141e");
}

TEST(MachineHash, FollowsGeometryNotNoise) {
  const auto plain = parse_config(kMachine, "a.toml");
  const auto noisier = parse_config(kMachine + "[tracker]\nsigma_range_um = 9\n", "b.toml");
  auto text = kMachine;
  text.replace(text.find("offset_mm = [20"), 15, "offset_mm = [21");
  const auto longer = parse_config(text, "c.toml");
  ASSERT_TRUE(plain && noisier && longer);
  EXPECT_EQ(machine_hash(*plain), machine_hash(*noisier));
  EXPECT_NE(machine_hash(*plain), machine_hash(*longer));
}

TEST(MachineHash, DependsOnTheSourceOfThePositions) {
  const std::string axes =
      R"({axis = "X", node = 1, step_nm = 10, offset_mm = 1}, {axis = "Y", node = 2},)";
  const std::string head = kMachine + kCanBus;
  const auto hash = [](const std::string& text) {
    return machine_hash(parse_config(text, "a.toml").value());
  };
  const auto replaced = [](std::string text, const std::string& what, const std::string& by) {
    return text.replace(text.find(what), what.size(), by);
  };
  const std::string plain = head + "nodes = [" + axes + R"({axis = "Z", node = 3}])";
  std::set<std::string> hashes{hash(plain), hash(kMachine)};
  for (const auto& [what, by] :
       std::map<std::string, std::string>{{"step_nm = 10", "step_nm = 11"},
                                          {"offset_mm = 1", "offset_mm = 1.001"},
                                          {"node = 1", "invert = true, node = 1"},
                                          {"node = 2", "node = 4"},
                                          {"nodes", "axes_compensated = true\nnodes"}})
    hashes.insert(hash(replaced(plain, what, by)));
  EXPECT_THAT(hashes, SizeIs(7));  // each of them another
}

TEST(MachineHash, DoesNotDependOnTheTransport) {
  const auto can = parse_config(kMachine + kCanBus + kNodes, "a.toml");
  const auto udp = parse_config(
      kMachine + "[encoder]\ntransport = \"udp\"\npeer_host = \"10.0.0.8\"\npeer_port = 9\n" +
          kNodes,
      "a.toml");
  ASSERT_TRUE(can && udp);
  EXPECT_EQ(machine_hash(*can), machine_hash(*udp));
}

TEST(MachineHash, OfAnAbsentTargetIsThatOfATargetInTheMiddle) {
  auto none = kMachine, zero = kMachine;
  const auto table = kMachine.find("[target]");
  const auto line = kMachine.find("offset_mm = [20"), end = kMachine.find('\n', line) + 1;
  zero.replace(line, end - line, "offset_mm = [0, 0, 0]\n");
  none.erase(table, end - table);
  EXPECT_EQ(machine_hash(parse_config(none, "a.toml").value()),
            machine_hash(parse_config(zero, "b.toml").value()));
}

}  // namespace
}  // namespace abbe::daemon
