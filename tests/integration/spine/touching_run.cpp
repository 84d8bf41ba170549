#include "touching_run.hpp"

#include <fmt/format.h>

namespace abbe::test {
namespace {

using nlohmann::json;

constexpr const char* kMachine = R"([machine]
name = "weak"
chain = "[w b Z X Y t]"
[axes.X]
min_mm = -150
max_mm = 650
[axes.Y]
min_mm = -150
max_mm = 400
[axes.Z]
min_mm = -50
max_mm = 150
[target]
offset_mm = [0, 0, 0]
[model]
node_spacing_mm = 50
[counter_card]
transport = "usbip"
zero = "here"
serial_number = "01ABBE08"
clock_MHz = 1
scan_rate_hz = 500
latch_channel = 6
)";

constexpr const char* kAxes = R"(axes = [
  { axis = "X", channel = 0, step_nm = 10 },
  { axis = "Y", channel = 1, step_nm = 10 },
  { axis = "Z", channel = 2, step_nm = 10 },
]
)";

constexpr const char* kSimulator = R"([sim]
machine = "machine.toml"
seed = 3
speed = {speed}
[sim.evemu]
probing_mm_per_s = 20
travel_mm_per_s = 500
points_per_ball = 6
points_per_block = 5
)";

constexpr const char* kEvemu = R"([evemu]
points_per_ball = 6
points_per_block = 5
)";

constexpr const char* kWarmArray = R"([sim.ball_array]
temperature_C = 23.4
alpha_um_per_m_K = 11.5
u_alpha_um_per_m_K = 0.5
u_ball_um = 1
u_block_urad = 3
[[sim.environment]]
name = "rtd"
model = "zt2005_c8"
input2_C = 23.4
input2_swing = 0.05
input2_swing_period_s = 120
)";

/// [evemu] comes right before it.
constexpr const char* kSensor = R"(artefact_sensor = "array"
u_artefact_K = 0.1
[[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
host = "127.0.0.1"
port = {port}
period_s = 0.5
inputs = ["", "", "array"]
)";

}  // namespace

void TouchingRun::warm_the_array() {
  warm_ = true;
  write("sim.toml", text_of(file("sim.toml")) + kWarmArray);
}

TouchingRun::TouchingRun() {
  write("machine.toml", fmt::format("{}{}", kMachine, kAxes));
  write("sim.toml", fmt::format(kSimulator, fmt::arg("speed", ABBE_SPINE_SPEED)));
}

void TouchingRun::start_touching_simulator(const std::vector<std::string>& more) {
  std::vector<std::string> command{
      ABBE_SIM_PROGRAM,        "evemu",        "--config",        file("sim.toml"),
      "--start-on-signal",     "--ports-file", file("ports"),     "--calibrator-out",
      file("calibrator.toml"), "--truth-out",  file("truth.csv"), "--reference-out",
      file("reference.csv")};
  command.insert(command.end(), more.begin(), more.end());
  simulator_ = start(std::move(command), "sim");
  ASSERT_TRUE(
      eventually([this] { return std::filesystem::exists(file("ports")) || !simulator_->running(); }));
  const std::string ports = text_of(file("ports"));
  const auto port = [&ports](const std::string& key) {
    const auto at = ports.find(key);
    return at == std::string::npos ? 0 : std::stoi(ports.substr(at + key.size()));
  };
  usbip_port_ = port("usbip_port=");
  sensor_port_ = port("rtd_port=");
  ASSERT_NE(usbip_port_, 0) << simulator_->err();
  ASSERT_EQ(sensor_port_ != 0, warm_) << ports;
}

void TouchingRun::write_touching_configuration(const std::string& gate, const std::string& dds,
                                               const std::string& probe) const {
  write("abbed.toml", kMachine + fmt::format("port = {}\n", usbip_port_) + kAxes + probe + "[gate]\n" + gate +
                          kEvemu + (warm_ ? fmt::format(kSensor, fmt::arg("port", sensor_port_)) : "") +
                          daemon_tables(dds));
}

std::vector<std::string> TouchingRun::calibrate_command(const std::string& calibrator) const {
  return {ABBE_PROGRAM, "calibrate", "evemu", "-c", file("abbed.toml"), "--calibrator", file(calibrator)};
}

Outcome TouchingRun::calibrate_touching(const std::string& calibrator) const {
  Program calibration(calibrate_command(calibrator), directory_ / "calibrate");
  EXPECT_TRUE(eventually([&] {
    const json now = session();
    return !calibration.running() || (now.is_object() && now["state"] == "warming");
  }));
  let_machine_go();
  const int code = calibration.wait_for_end();
  return {code, calibration.out(), calibration.err()};
}

json TouchingRun::session() const {
  const json now = status();
  return now.is_object() ? now["session"] : json();
}

}  // namespace abbe::test
