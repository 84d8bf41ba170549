#include "touching_run.hpp"

#include <fmt/format.h>

#include "config_tables.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;

std::string machine_tables(const std::string& at_its_port = {}) {
  return to_toml(config_tables::Machine{.name = "weak",
                                        .chain = "[w b Z X Y t]",
                                        .x = {-150, 650},
                                        .y = {-150, 400},
                                        .z = {-50, 150},
                                        .target_offset_mm = {{0, 0, 0}},
                                        .node_spacing_mm = 50}) +
         to_toml(config_tables::CounterCard{.scan_rate_hz = 500, .more = at_its_port});
}

constexpr const char* kBallArraySimulator = R"([sim]
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
  write("machine.toml", machine_tables());
  write("sim.toml", fmt::format(kBallArraySimulator, fmt::arg("speed", ABBE_SPINE_SPEED)));
}

void TouchingRun::start_touching_simulator(const std::vector<std::string>& more) {
  std::vector<std::string> command{
      ABBE_SIM_PROGRAM,        "evemu",        "--config",        file("sim.toml"),
      "--start-on-signal",     "--ports-file", file("ports"),     "--calibrator-out",
      file("calibrator.toml"), "--truth-out",  file("truth.csv"), "--reference-out",
      file("reference.csv")};
  command.insert(command.end(), more.begin(), more.end());
  ASSERT_NO_FATAL_FAILURE(start_simulator_as(std::move(command)));
  usbip_port_ = port("usbip_port");
  sensor_port_ = port("rtd_port");
  ASSERT_NE(usbip_port_, 0) << simulator_->err();
  ASSERT_EQ(sensor_port_ != 0, warm_) << text_of(file("ports"));
}

void TouchingRun::write_touching_configuration(const std::string& gate, const std::string& dds,
                                               const std::string& probe) const {
  write("abbed.toml", machine_tables(fmt::format("port = {}\n", usbip_port_)) + probe + "[gate]\n" +
                          gate + kEvemu +
                          (warm_ ? fmt::format(kSensor, fmt::arg("port", sensor_port_)) : "") +
                          daemon_tables(dds));
}

std::vector<std::string> TouchingRun::calibrate_command(const std::string& calibrator) const {
  return {ABBE_PROGRAM,       "calibrate",    "evemu",         "-c",
          file("abbed.toml"), "--calibrator", file(calibrator)};
}

Outcome TouchingRun::calibrate_touching(const std::string& calibrator) const {
  Program calibration(calibrate_command(calibrator), directory_ / "calibrate");
  EXPECT_TRUE(eventually([&] {
    const json now = session();
    return !calibration.running() || (now.is_object() && now["state"] == "warming");
  }));
  let_machine_go();
  const int code = calibration.wait_for_end(kPatienceForARun);
  return {code, calibration.out(), calibration.err()};
}

json TouchingRun::session() const {
  const json now = status();
  return now.is_object() ? now["session"] : json();
}

}  // namespace abbe::test
