#pragma once
/// abbed and abbe-sim as processes, asked by `abbe status --json` as a person would, in a folder
/// that goes with the test. Real-time threads: needs root.
///
/// ABBE_HIL_SECONDS: of the measured run (default 20).

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "config_tables.hpp"
#include "figure.hpp"
#include "process_use.hpp"
#include "program.hpp"
#include "run_time.hpp"

namespace abbe::tests {

inline int run_seconds() {
  return static_cast<int>(run_time(std::chrono::seconds{20}).count());
}

class WholeDaemon : public testing::Test {
 protected:
  using json = nlohmann::json;
  /// A stream of the status and how many samples a second it must bring at least; 0: comes when it
  /// likes.
  struct Stream {
    std::string name;
    double rate_hz = 0.0;
    double slack_s = 0.01;  ///< what comes in bursts may still be to come
  };

  inline static const Stream kTracker{"tracker", 500.0, 0.4};
  inline static const Stream kAir{"air", 1.0, 1.0};

  WholeDaemon() {
    std::string name = testing::TempDir() + "abbe-hil-XXXXXX";
    directory_ = ::mkdtemp(name.data());
  }
  ~WholeDaemon() override {
    if (HasFailure()) {
      for (const char* log : {"abbed.err", "sim.err"})
        fmt::print("--- {}\n{}\n", log, test::text_of(file(log)));
      fmt::print("--- status\n{}\n", status().dump(1));
    }
    abbed_.reset();
    simulator_.reset();
    std::filesystem::remove_all(directory_);
  }

  /// `simulated`: further tables of the simulator; `wired`: of both, `read`: of the daemon.
  /// PORT_OF(name) in them is the simulator's port of that name, 0 in its own file.
  void start_all(const std::string& simulated, const std::string& wired, const std::string& read) {
    write("machine.toml", to_toml(config_tables::mill()) + with_ports(wired));
    write("sim.toml", kSimulator + simulated);
    write("path.csv", path());
    // Above everything of abbed: what it stands for takes no processor time at all.
    simulator_ = start({"/usr/bin/chrt", "-f", "90", ABBE_SIM_PROGRAM, "run", "--config",
                        file("sim.toml"), "--ports-file", file("ports")},
                       "sim");
    ASSERT_TRUE(test::eventually(
        [this] { return std::filesystem::exists(file("ports")) || !simulator_->running(); }));
    write("abbed.toml", to_toml(config_tables::mill()) + with_ports(wired + kDaemon + read) +
                            fmt::format("[recording]\nmin_free_MB = 1\nraw = {}\n", records_raw()));
    abbed_ = start({ABBED_PROGRAM, "--config", file("abbed.toml")}, "abbed");
  }
  /// A card's bytes of ten minutes do not fit into the guest's memory.
  [[nodiscard]] bool records_raw() const {
    constexpr std::uintmax_t kAll_bytes = 2'000'000'000;
    return run_seconds() <= 60 || std::filesystem::space(directory_).available > kAll_bytes;
  }
  /// Waits for all, then measures.
  void expect_nothing_lost(const std::vector<Stream>& streams) {
    const auto comes = [this](const Stream& s) {
      const json now = stream(s.name);
      return s.rate_hz > 0.0 ? now.value("samples", 0) > 0 : now.value("state", "") == "streaming";
    };

    for (const auto& s : streams) ASSERT_TRUE(test::eventually([&] { return comes(s); })) << s.name;
    ::sleep(2);
    std::vector<json> before;
    for (const auto& s : streams) before.push_back(stream(s.name));
    const int seconds = run_seconds();
    const ProcessUse use{abbed_->pid(), seconds};
    for (std::size_t i = 0; i < streams.size(); ++i) expect_nothing_lost(streams[i], before[i]);
    print_figure("whole daemon, use", fmt::format("second half grows < {} kB", kFlat_kB),
                 "{:.1f} % of one processor, resident {}", use.percent(), use.memory());

    EXPECT_LT(use.late_growth_kB(), kFlat_kB);
  }

  [[nodiscard]] bool becomes(const std::string& name, const std::string& state) const {
    return test::eventually([&] { return stream(name).value("state", "") == state; });
  }
  [[nodiscard]] json stream(const std::string& name) const {
    const json now = status();
    if (now.is_object())
      for (const json& s : now["streams"])
        if (s["name"] == name) return s;
    return json::object();
  }
  /// Stops the daemon; its recording.
  [[nodiscard]] std::string recording_of_stopped() {
    EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
    for (const auto& entry :
         std::filesystem::directory_iterator(directory_ / "data" / "recordings"))
      return entry.path();
    return {};
  }
  [[nodiscard]] std::string replay(const std::string& recording, const std::string& as) const {
    test::Program tool({ABBE_PROGRAM, "replay", as, recording}, directory_ / "replay");
    EXPECT_LE(tool.wait_for_end(), 1) << tool.err();  // 1: no calibration in it
    return tool.out();
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    return (directory_ / name).string();
  }

  std::filesystem::path directory_;
  std::unique_ptr<test::Program> simulator_;
  std::unique_ptr<test::Program> abbed_;

 private:
  /// Memory is locked, so what it holds is resident. A recording's index grows with it, some 100
  /// bytes a chunk; a leak of 16 bytes a sample would be 5 MB in half of ten minutes.
  static constexpr long kFlat_kB = 1024;
  static constexpr const char* kSimulator = R"(
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
[[sim.environment]]
name = "air"
model = "comet_t7510"
serial_number = 20961234
)";
  static constexpr const char* kDaemon = R"(
[tracker]
host = "127.0.0.1"
port = PORT_OF(tracker_port)
point_rate_hz = 500
weather = "none"
u_scale_ppm = 0
[[environment]]
name = "air"
map = "comet-t7510"
host = "127.0.0.1"
port = PORT_OF(air_port)
serial_number = 20961234
[daemon]
data_dir = "data"
runtime_dir = "run"
simulated = true
realtime = "enforce"
[dds]
supervise = "off"
)";
  /// A small volume again and again, longer than the run.
  static std::string path() {
    constexpr int kLap_s = 15;
    std::string text = "x_mm,y_mm,z_mm\n";
    for (int lap = 0; lap <= 2 + run_seconds() / kLap_s; ++lap)
      text += "-50,-50,-250\n50,50,-150\n-50,50,-250\n50,-50,-150\n";
    return text;
  }
  [[nodiscard]] std::string with_ports(std::string text) const {
    constexpr std::string_view kCall = "PORT_OF(";
    const std::string ports = test::text_of(file("ports"));
    for (auto at = text.find(kCall); at != std::string::npos; at = text.find(kCall)) {
      const auto end = text.find(')', at);
      const auto name = text.substr(at + kCall.size(), end - at - kCall.size()) + "=";
      const auto port = ports.find(name);
      text.replace(at, end + 1 - at,
                   port == std::string::npos
                       ? "0"
                       : std::to_string(std::stoi(ports.substr(port + name.size()))));
    }
    return text;
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream{directory_ / name} << text;
  }
  [[nodiscard]] std::unique_ptr<test::Program> start(std::vector<std::string> command,
                                                     const std::string& log) const {
    return std::make_unique<test::Program>(std::move(command), directory_ / log);
  }
  [[nodiscard]] json status() const {
    test::Program tool({ABBE_PROGRAM, "status", "--json", "-c", file("abbed.toml")},
                       directory_ / "status");
    if (tool.wait_for_end() != 0) return {};
    return json::parse(tool.out(), nullptr, false);
  }
  void expect_nothing_lost(const Stream& wanted, const json& before) const {
    const json after = stream(wanted.name);
    const auto more = after["samples"].get<double>() - before["samples"].get<double>();
    EXPECT_GE(more, (run_seconds() - wanted.slack_s) * wanted.rate_hz) << after.dump(1);
    for (const char* counter : {"dropped", "gaps", "faults"})
      EXPECT_EQ(after[counter], before[counter]) << after.dump(1);
    print_figure("whole daemon, " + wanted.name, "0 lost",
                 "{} samples, {} gaps, {} dropped, latency p99 {:.0f} us", more,
                 after["gaps"].get<int>() - before["gaps"].get<int>(), after["dropped"].get<int>(),
                 1e6 * after["latency_p99_s"].get<double>());
  }
};

}  // namespace abbe::tests
