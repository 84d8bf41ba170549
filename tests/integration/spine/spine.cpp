#include "spine.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>

#include <algorithm>
#include <fstream>

#include "abbe/base/control_protocol.hpp"
#include "abbe/tables/input_files.hpp"
#include "config_tables.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;

std::string machine_table(std::string_view rotary_axes) {
  return to_toml(config_tables::Machine{.name = "spine",
                                        .x = {-100, 100},
                                        .y = {-100, 100},
                                        .z = {-200, 0},
                                        .rotary = rotary_axes,
                                        .target_offset_mm = {{20, -15, -120}},
                                        .node_spacing_mm = 100});
}

constexpr const char* kSimulator = R"(
[sim]
machine = "machine.toml"
seed = 7
speed = {speed}
[sim.truth]
mean_error_um = 60
node_spacing_mm = 100
[sim.path]
file = "path.csv"
feed_mm_per_min = 10000
acceleration_mm_per_s2 = 1000
dwell_s = 0.05
standstill_s = 8
[sim.tracker]
position_mm = [-350, -320, -150]
rotation_rad = [0.0013, -0.0342, 1.1003]
)";

// The demo's walk between the corners and centres of its volume, as long as the 3 x 3 x 3 nodes
// here need it.
constexpr std::size_t kLegs = 40;
// The demo's volume (600 x 500 x 400 mm) on this one (200 mm each).
constexpr std::array<double, 3> kShrink{200.0 / 600.0, 200.0 / 500.0, 200.0 / 400.0};

constexpr const char* kDaemon = R"(speed = {}
realtime = "ignore"
[recording]
min_free_MB = 1
chunk_kB = 16
)";

}  // namespace

Spine::Spine(std::string_view rotary_axes) : rotary_axes_(rotary_axes) {
  std::string name = testing::TempDir() + "abbe-spine-XXXXXX";
  directory_ = ::mkdtemp(name.data());
  write("machine.toml", machine_table(rotary_axes_));
  write("sim.toml", fmt::format(kSimulator, fmt::arg("speed", ABBE_SPINE_SPEED)));
}

Spine::~Spine() {
  if (HasFailure()) {
    for (const char* log : {"abbed.err", "sim.err"})
      fmt::print("--- {}\n{}\n", log, text_of(file(log)));
    fmt::print("--- status\n{}\n", status().dump(1));
  }
  abbed_.reset();
  simulator_.reset();
  std::filesystem::remove_all(directory_);
}

void Spine::write(const std::string& name, const std::string& text) const {
  std::ofstream{directory_ / name, std::ios::binary} << text;
}

void Spine::write_path(const std::string& name, const Vertices& vertices_mm) const {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (const auto& v : vertices_mm) text += fmt::format("{},{},{}\n", v[0], v[1], v[2]);
  write(name, text);
}

Spine::Vertices Spine::path() {
  const auto demo = daemon::read_path_csv(ABBE_DEMO_PATH);
  EXPECT_TRUE(demo && demo->vertices_m.size() > kLegs);
  Vertices vertices_mm;
  for (std::size_t i = 0; demo && i <= kLegs; ++i) {
    auto& v = vertices_mm.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) v[k] = demo->vertices_m[i][k] * 1e3 * kShrink[k];
  }
  return vertices_mm;
}

void Spine::write_configuration(const std::string& dds) const {
  write_configuration_of(tracker_table() + to_toml(config_tables::Encoder{.peer_port = can_port_,
                                                                          .sync_period_us = 10'000,
                                                                          .step_nm = 10,
                                                                          .rotary = rotary_axes_}),
                         dds);
}

void Spine::write_configuration_of(const std::string& devices, const std::string& dds) const {
  write("abbed.toml", machine_table(rotary_axes_) + devices + daemon_tables(dds));
}

std::string Spine::tracker_table() const {
  return to_toml(config_tables::Tracker{
      .port = tracker_port_,
      .more = "weather = \"none\"\nu_scale_ppm = 0\nsigma_range_um = 2\nsigma_angle_urad = 3\n"});
}

std::string Spine::daemon_tables(const std::string& dds) const {
  return std::string{config_tables::kDaemonInItsFolder} + fmt::format(kDaemon, ABBE_SPINE_SPEED) +
         to_toml(config_tables::Dds{.domain = domain_.text(),
                                    .profile = ABBE_LOOPBACK_PROFILE,
                                    .more = fmt::format("supervise = \"{}\"\n", dds)});
}

void Spine::start_simulator() {
  ASSERT_NO_FATAL_FAILURE(start_simulator_as(
      {ABBE_SIM_PROGRAM, "run", "--config", file("sim.toml"), "--ports-file", file("ports")}));
  tracker_port_ = port("tracker_port");
  can_port_ = port("can_port");
  ASSERT_NE(tracker_port_, 0) << simulator_->err();
}

void Spine::start_simulator_as(std::vector<std::string> command) {
  simulator_ = start(std::move(command), "sim");
  ASSERT_TRUE(eventually(
      [this] { return std::filesystem::exists(file("ports")) || !simulator_->running(); }));
}

std::uint16_t Spine::port(const std::string& name) const {
  const std::string ports = text_of(file("ports"));
  const auto at = ports.find(name + "=");
  return at == std::string::npos
             ? 0
             : static_cast<std::uint16_t>(std::stoi(ports.substr(at + name.size() + 1)));
}

void Spine::start_abbed() {
  abbed_ = start({ABBED_PROGRAM, "--config", file("abbed.toml")}, "abbed");
  ASSERT_TRUE(eventually([this] { return status().is_object() || !abbed_->running(); }));
  ASSERT_TRUE(abbed_->running()) << abbed_->err();
}

std::unique_ptr<Program> Spine::start(std::vector<std::string> command,
                                      const std::string& log) const {
  return std::make_unique<Program>(std::move(command), directory_ / log);
}

Outcome Spine::run(std::vector<std::string> command) const {
  Program program(std::move(command), directory_ / "tool");
  const int code = program.wait_for_end();
  return {code, program.out(), program.err()};
}

void Spine::hold_simulator() const {
  simulator_->signal(SIGSTOP);
}

Outcome Spine::calibrate(const std::string& path) const {
  Program calibration(
      {ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--path", file(path)},
      directory_ / "calibrate");
  EXPECT_TRUE(eventually([&] {
    const json now = status();
    return !calibration.running() || (now.is_object() && now["session"]["state"] == "warming");
  }));
  simulator_->signal(SIGCONT);
  const int code = calibration.wait_for_end(kPatienceForARun);
  return {code, calibration.out(), calibration.err()};
}

json Spine::status() const {
  const auto answer = daemon::ask_daemon(directory_ / "run" / "control.sock", {{"do", "status"}});
  return answer ? *answer : json();
}

json Spine::stream(const std::string& name) const {
  const json now = status();
  if (!now.is_object()) return json::object();
  for (const json& s : now["streams"])
    if (s["name"] == name) return s;
  return json::object();
}

std::uint64_t Spine::samples(const std::string& name) const {
  return stream(name).value("samples", std::uint64_t{0});
}

bool Spine::goes_on(const std::string& name) const {
  const auto before = samples(name);
  return eventually([&] { return samples(name) > before; });
}

std::vector<std::filesystem::path> Spine::recordings() const {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(directory_ / "data" / "recordings"))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace abbe::test
