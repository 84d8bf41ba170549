// The whole daemon in the guest: abbe-sim on a virtual CAN bus and on TCP, abbed with real-time threads,
// asked by `abbe status --json` as a person would. In virtual time, so that nothing may be lost.
//
// ABBE_HIL_SECONDS: virtual seconds of the run (default 20).

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "can_interface.hpp"
#include "figure.hpp"
#include "program.hpp"
#include "run_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::eventually;
using test::Program;
using testing::HasSubstr;

constexpr double kEncoder_hz = 980.0;       // CAN_BCM makes each period a few us too long
constexpr double kCounterCard_hz = 1010.0;  // every 33rd scan
constexpr double kTracker_hz = 500.0;
constexpr double kAir_hz = 1.0;
constexpr double kLongestBurst_s = 0.4;

constexpr const char* kMachine = R"(
[machine]
name = "hil"
chain = "[w X' b Y Z (C1) t]"
[axes.X]
min_mm = -300
max_mm = 300
[axes.Y]
min_mm = -250
max_mm = 250
[axes.Z]
min_mm = -400
max_mm = 0
[target]
offset_mm = [20, -15, -120]
[model]
node_spacing_mm = 100
)";

constexpr const char* kSimulator = R"(
[sim]
machine = "machine.toml"
seed = 3
[sim.path]
file = "path.csv"
feed_mm_per_min = 2500
start_when_streaming = false
[sim.tracker]
position_mm = [-750, -620, -350]
rotation_rad = [0.0013, -0.0342, 1.1003]
initialize_s = 0.2
[sim.encoder]
interface = "vcan7"
[[sim.environment]]
name = "air"
model = "comet_t7510"
serial_number = 20961234
)";

/// The axes come from one of these.
constexpr const char* kEncoder = R"(
[encoder]
transport = "socketcan"
interface = "vcan7"
sync = "kernel"
sync_period_us = 1000
nodes = [
  { axis = "X", node = 1, step_nm = 10 },
  { axis = "Y", node = 2, step_nm = 10 },
  { axis = "Z", node = 3, step_nm = 10 },
]
)";
constexpr const char* kCounterCard = R"(
axes = [
  { axis = "X", channel = 0, step_nm = 10 },
  { axis = "Y", channel = 1, step_nm = 10 },
  { axis = "Z", channel = 2, step_nm = 10 },
]
transport = "usbip"
clock_MHz = 1
latch_channel = 6
edge_channel = 7
sample_every = 33
)";

constexpr const char* kDaemon = R"(
[tracker]
host = "127.0.0.1"
port = {port}
point_rate_hz = 500
weather = "none"
[[environment]]
name = "air"
map = "comet-t7510"
host = "127.0.0.1"
port = {air_port}
serial_number = 20961234
[daemon]
data_dir = "data"
runtime_dir = "run"
simulated = true
realtime = "enforce"
[recording]
min_free_MB = 1
[dds]
supervise = "off"
)";

int run_seconds() {
  return static_cast<int>(run_time(20s).count());
}

struct Use {
  double processor_s = 0.0;
  long resident_kB = 0;
};
Use use_of(pid_t pid) {
  Use use;
  std::ifstream stat{fmt::format("/proc/{}/stat", pid)};
  std::string text{std::istreambuf_iterator<char>{stat}, {}};
  std::istringstream fields{text.substr(text.rfind(')') + 2)};
  std::string skipped;
  long user = 0;
  long system = 0;
  for (int field = 3; field < 14; ++field) fields >> skipped;  // proc(5): utime is field 14
  fields >> user >> system;
  use.processor_s = static_cast<double>(user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  std::ifstream status{fmt::format("/proc/{}/status", pid)};
  for (std::string word; status >> word;) {
    if (word == "VmRSS:") status >> use.resident_kB;
  }
  return use;
}

class WholeDaemon : public testing::Test {
 protected:
  WholeDaemon() {
    std::string name = testing::TempDir() + "abbe-hil-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~WholeDaemon() override {
    if (!HasFailure()) return;
    for (const char* log : {"abbed.err", "sim.err"})
      fmt::print("--- {}\n{}\n", log, test::text_of(file(log)));
    fmt::print("--- status\n{}\n", status().dump(1));
  }

  /// `axes` is the table of both that the axes come from, `card` that of a counter card without its port.
  void start_all(const std::string& axes, const std::string& card = "") {
    const std::string any_port = card.empty() ? "" : "[counter_card]\n" + card;
    write("machine.toml", kMachine + axes + any_port);
    write("sim.toml", kSimulator);
    write("path.csv", "x_mm,y_mm,z_mm\n-300,-250,-400\n300,250,0\n-300,250,-400\n300,-250,0\n");
    // Above everything of abbed: what it stands for takes no processor time at all.
    simulator_ = start({"/usr/bin/chrt", "-f", "90", ABBE_SIM_PROGRAM, "run", "--config", file("sim.toml"),
                        "--ports-file", file("ports")},
                       "sim");
    ASSERT_TRUE(
        eventually([this] { return std::filesystem::exists(file("ports")) || !simulator_->running(); }));
    const std::string at_its_port =
        card.empty() ? "" : fmt::format("[counter_card]\nport = {}\n", port("usbip_port")) + card;
    write("abbed.toml", kMachine + axes + at_its_port +
                            fmt::format(kDaemon, fmt::arg("port", port("tracker_port")),
                                        fmt::arg("air_port", port("air_port"))));
    abbed_ = start({ABBED_PROGRAM, "--config", file("abbed.toml")}, "abbed");
  }
  [[nodiscard]] int port(const std::string& name) const {
    const std::string ports = test::text_of(file("ports"));
    const auto at = ports.find(name + "=");
    EXPECT_NE(at, std::string::npos) << name << ": " << ports << simulator_->err();
    return at == std::string::npos ? 1 : std::stoi(ports.substr(at + name.size() + 1));
  }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream{directory_ / name} << text;
  }
  [[nodiscard]] std::string file(const std::string& name) const { return (directory_ / name).string(); }
  [[nodiscard]] std::unique_ptr<Program> start(std::vector<std::string> command,
                                               const std::string& log) const {
    return std::make_unique<Program>(std::move(command), directory_ / log);
  }
  [[nodiscard]] json status() const {
    Program tool({ABBE_PROGRAM, "status", "--json", "-c", file("abbed.toml")}, directory_ / "status");
    if (tool.wait_for_end() != 0) return {};
    return json::parse(tool.out(), nullptr, false);
  }
  [[nodiscard]] json stream(const std::string& name) const {
    const json now = status();
    if (now.is_object())
      for (const json& s : now["streams"])
        if (s["name"] == name) return s;
    return json::object();
  }
  [[nodiscard]] bool streams(const std::string& name) const {
    return eventually([&] { return stream(name).value("state", "") == "streaming"; });
  }

  /// `before` and `after` are `seconds` apart or a little more.
  static void expect_nothing_lost(const json& before, const json& after, double rate_hz, double slack_s) {
    const auto more = after["samples"].get<double>() - before["samples"].get<double>();
    EXPECT_GE(more, (run_seconds() - slack_s) * rate_hz) << after.dump(1);
    for (const char* counter : {"dropped", "gaps", "faults"})
      EXPECT_EQ(after[counter], before[counter]) << after.dump(1);
    print_figure("whole daemon, " + after["name"].get<std::string>(), "0 lost",
                 "{} samples, {} gaps, {} dropped, latency p99 {:.0f} us", more,
                 after["gaps"].get<int>() - before["gaps"].get<int>(), after["dropped"].get<int>(),
                 1e6 * after["latency_p99_s"].get<double>());
  }

  /// All devices at once, with the axes from `axes`.
  void expect_nothing_lost_with(const std::string& axes, double axes_hz) {
    ASSERT_TRUE(streams(axes)) << stream(axes).dump(1);
    ASSERT_TRUE(streams("tracker"));
    ASSERT_TRUE(eventually([&] { return stream("air").value("samples", 0) > 0; })) << stream("air").dump(1);
    ::sleep(1);
    const json axes_before = stream(axes);
    const json tracker = stream("tracker");
    const json air = stream("air");
    const Use use = use_of(abbed_->pid());
    ::sleep(static_cast<unsigned>(run_seconds()));
    expect_nothing_lost(axes_before, stream(axes), axes_hz, 0.01);
    expect_nothing_lost(tracker, stream("tracker"), kTracker_hz, kLongestBurst_s);
    expect_nothing_lost(air, stream("air"), kAir_hz, 1.0);
    const Use used = use_of(abbed_->pid());
    print_figure("whole daemon, use with " + axes, "memory flat",
                 "{:.1f} % of the guest's processor, resident {} kB, at first {} kB",
                 100.0 * (used.processor_s - use.processor_s) / run_seconds(), used.resident_kB,
                 use.resident_kB);
    // Memory is locked, so what it holds is resident: a leak of one sample a second would show in the soak.
    EXPECT_LT(used.resident_kB, use.resident_kB + 2048);
  }

  std::filesystem::path directory_;
  VirtualCan vcan_;
  std::unique_ptr<Program> simulator_;
  std::unique_ptr<Program> abbed_;
};

TEST_F(WholeDaemon, AcquiresFromAllDevicesWithoutLossAndComesBackAfterTheBusWasDown) {
  ASSERT_NO_FATAL_FAILURE(start_all(kEncoder));
  ASSERT_NO_FATAL_FAILURE(expect_nothing_lost_with("encoder", kEncoder_hz));
  vcan_.down();
  ASSERT_TRUE(eventually([&] { return stream("encoder").value("state", "") == "closed"; }));
  EXPECT_THAT(stream("encoder").value("last_fault", ""), HasSubstr("vcan7"));
  vcan_.up();
  EXPECT_TRUE(streams("encoder"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
}

TEST_F(WholeDaemon, AcquiresFromACounterCardWithoutLoss) {
  ASSERT_NO_FATAL_FAILURE(start_all("", kCounterCard));
  ASSERT_NO_FATAL_FAILURE(expect_nothing_lost_with("counter_card", kCounterCard_hz));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
}

TEST_F(WholeDaemon, RecordsWithoutLoss) {
  ASSERT_NO_FATAL_FAILURE(start_all(kEncoder));
  ASSERT_TRUE(streams("encoder"));
  ASSERT_TRUE(streams("tracker"));
  ::sleep(2);
  ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
  std::filesystem::path recording;
  for (const auto& entry : std::filesystem::directory_iterator(directory_ / "data" / "recordings"))
    recording = entry.path();
  Program replay({ABBE_PROGRAM, "replay", "--json", recording}, directory_ / "replay");
  EXPECT_LE(replay.wait_for_end(), 1) << replay.err();  // 1: no calibration in it
  const json said = json::parse(replay.out(), nullptr, false);
  ASSERT_TRUE(said.is_object()) << replay.out() << replay.err();
  EXPECT_EQ(said["losses"], json::array()) << said.dump(1);
}

}  // namespace
}  // namespace abbe::tests
