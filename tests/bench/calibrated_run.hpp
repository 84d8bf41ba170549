#pragma once
/// A calibration on the fly in real time: a simulated machine with a tracker at 500 Hz and encoders
/// of five axes at 200 Hz, and abbed, each a process, in a temporary folder.

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/control_protocol.hpp"
#include "abbe/tables/input_files.hpp"
#include "acquisition_phase.hpp"
#include "config_tables.hpp"
#include "program.hpp"

namespace abbe::bench {

inline constexpr std::string_view kSimulator = R"([sim]
machine = "machine.toml"
seed = 7
speed = 1
[sim.truth]
mean_error_um = 60
[sim.path]
file = "{}"
feed_mm_per_min = 10000
acceleration_mm_per_s2 = 1000
standstill_s = 10
[sim.tracker]
position_mm = [-750, -620, -350]
rotation_rad = [0.0013, -0.0342, 1.1003]
)";

inline constexpr std::string_view kDaemon = R"(speed = 1
realtime = "ignore"
[recording]
min_free_MB = 1
[dds]
supervise = "off"
)";

/// True if the answer has a determined table: a number as uncertainty of every node, not all of
/// them 0, as those of nodes that the datum sets to 0 are.
inline bool has_tables(const nlohmann::json& status) {
  const nlohmann::json& session = status["session"];
  if (session["state"] != "acquiring" || !session.contains("live")) return false;
  const auto is_number = [](const nlohmann::json& u) { return u.is_number(); };
  const auto is_positive = [](const nlohmann::json& u) { return u.get<double>() > 0.0; };
  return std::ranges::any_of(session["live"]["tables"], [&](const nlohmann::json& table) {
    const nlohmann::json& u = table["u"];
    return table["determined"].get<bool>() && std::ranges::all_of(u, is_number) &&
           std::ranges::any_of(u, is_positive);
  });
}

class CalibratedRun {
 public:
  /// `more`: lines of abbed.toml after its other tables.
  explicit CalibratedRun(std::string_view more = {}) {
    std::string name = std::filesystem::temp_directory_path() / "abbe-live-status-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    write("machine.toml", to_toml(machine()));
    write("sim.toml", fmt::format(kSimulator, ABBE_DEMO_PATH));
    simulator_ = start(
        {ABBE_SIM_PROGRAM, "run", "--config", file("sim.toml"), "--ports-file", file("ports")},
        "sim");
    wait_for("the simulator", [this] { return std::filesystem::exists(file("ports")); });
    write("abbed.toml", configuration() + std::string{more});
    abbed_ = start({ABBED_PROGRAM, "--config", file("abbed.toml")}, "abbed");
    wait_for("abbed", [this] { return ask({{"do", "status"}}).is_object(); });
  }
  CalibratedRun(const CalibratedRun&) = delete;
  CalibratedRun& operator=(const CalibratedRun&) = delete;
  ~CalibratedRun() {
    abbed_.reset();
    simulator_.reset();
    std::filesystem::remove_all(folder_);
  }

  /// Returns when the machine moves and the first table is determined.
  void calibrate() {
    const auto path = daemon::read_path_csv(ABBE_DEMO_PATH);
    if (!path) throw std::runtime_error(path.error().text);
    const nlohmann::json answer = ask(
        {{"do", "calibrate"}, {"method", "otf"}, {"path_m", path->vertices_m}, {"who", "bench"}});
    if (!answer.value("ok", false)) throw std::runtime_error("calibrate: " + answer.dump());
    wait_for(
        "the first determined table", [this] { return has_tables(status()); },
        test::kPatienceForARun);
  }
  [[nodiscard]] nlohmann::json ask(const nlohmann::json& request) const {
    const auto answer = daemon::ask_daemon(folder_ / "run" / "control.sock", request);
    return answer ? *answer : nlohmann::json{};
  }
  [[nodiscard]] nlohmann::json status() const {
    nlohmann::json now = ask({{"do", "status"}});
    if (!now.is_object()) throw std::runtime_error("abbed does not answer:\n" + abbed_->err());
    return now;
  }
  [[nodiscard]] AcquisitionPhases acquisition() const {
    return acquisition_until_now(status(), abbed_->pid());
  }
  [[nodiscard]] bool show_status() const {
    const auto command = fmt::format("'{}' status -c '{}' >'{}'", ABBE_PROGRAM, file("abbed.toml"),
                                     file("status.txt"));
    return std::system(command.c_str()) == 0;  // NOLINT(cert-env33-c): the user's way
  }

  /// Output and errors of the program are in the files `log`.out and `log`.err.
  [[nodiscard]] std::unique_ptr<test::Program> start(std::vector<std::string> command,
                                                     const std::string& log) const {
    return std::make_unique<test::Program>(std::move(command), folder_ / log);
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_ / name; }
  template <class Condition>
  void wait_for(std::string_view what, Condition seen,
                std::chrono::seconds at_most = test::kPatience) {
    if (!test::eventually(seen, at_most))
      throw std::runtime_error(fmt::format("{} did not appear within {} s; abbed: {}", what,
                                           at_most.count(),
                                           abbed_ ? abbed_->err() : "not started"));
  }

 private:
  static constexpr std::string_view kRotary = "BC";

  static config_tables::Machine machine() {
    auto of_demo = config_tables::case_a();
    of_demo.name = "live status";
    of_demo.rotary = kRotary;
    return of_demo;
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream{folder_ / name, std::ios::binary} << text;
  }
  [[nodiscard]] std::uint16_t port(const std::string& name) const {
    const std::string ports = test::text_of(folder_ / "ports");
    const auto at = ports.find(name + "=");
    if (at == std::string::npos) throw std::runtime_error("the simulator has no " + name);
    return static_cast<std::uint16_t>(std::stoi(ports.substr(at + name.size() + 1)));
  }
  [[nodiscard]] std::string configuration() const {
    return to_toml(machine()) +
           to_toml(config_tables::Tracker{
               .port = port("tracker_port"),
               .more = "weather = \"none\"\nu_scale_ppm = 0\nsigma_range_um = 2\n"
                       "sigma_angle_urad = 3\n"}) +
           to_toml(config_tables::Encoder{.peer_port = port("can_port"),
                                          .sync_period_us = 5'000,
                                          .step_nm = 10,
                                          .rotary = kRotary}) +
           std::string{config_tables::kDaemonInItsFolder} + std::string{kDaemon};
  }
  std::filesystem::path folder_;
  std::unique_ptr<test::Program> simulator_, abbed_;
};

}  // namespace abbe::bench
