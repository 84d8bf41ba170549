// Any lines as requests of the control socket, answered by a hub with tracker, counter card, marks
// and measuring machine that no device is behind: every answer is an object with "ok", and one
// line. The first byte chooses who asks.
//
// No look for leaks after each input that leaves memory behind (a session's notes): it takes half
// of the time, and the tests of the control socket run with it.
//
// libFuzzer: -max_len=4096 -dict=tests/fuzz/control.dict -detect_leaks=0

#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/base/bounded_json.hpp"
#include "abbe/service/control_api.hpp"
#include "json_line.hpp"

namespace {

using namespace abbe;
using namespace abbe::daemon;
using nlohmann::json;

constexpr std::string_view kConfig = R"([machine]
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
[tracker]
host = "127.0.0.1"
[counter_card]
transport = "usbip"
port = 3240
axes = [{axis = "X", channel = 0, step_nm = 250}, {axis = "Y", channel = 1, step_nm = 250},
        {axis = "Z", channel = 2, step_nm = 250}]
[cmm]
host = "127.0.0.1"
axes_compensated = false
[reference]
transport = "usbip"
port = 3241
axes = [{axis = "Z", channel = 2, signal_period_um = 20, length_mm = 500, zero_mark_mm = 10}]
)";

void require(bool holds) {
  if (!holds) std::abort();
}

struct NoDevices final : SampleSource {
  void drain(Batch&) override {}
  [[nodiscard]] std::vector<StreamHealth> health(protocol::HostTime) override { return {}; }
  [[nodiscard]] Result<std::array<double, 3>> machine_position() const override {
    return std::array<double, 3>{0.1, 0.2, -0.3};
  }
  [[nodiscard]] std::optional<drivers::DeviceStatus> tracker_status() const override {
    return drivers::DeviceStatus{.name = "tracker", .state = "streaming", .connected = true};
  }
};

Config config_of_mill() {
  auto config = parse_config(kConfig, "fuzz.toml");
  require(config.has_value());
  return std::move(*config);
}

std::filesystem::path empty_store() {
  std::string name = (std::filesystem::temp_directory_path() / "abbe-fuzz-control-XXXXXX").string();
  require(::mkdtemp(name.data()) != nullptr);
  return name;
}

/// The daemon without its threads.
struct Daemon {
  Config config = config_of_mill();
  drivers::MonotonicTime time;
  NoDevices devices;
  ModelAuthority authority = ModelAuthority::open(empty_store(), config, {}, time.now());
  CalibrationService calibration{config, authority, nullptr};
  ReferenceService reference{config, nullptr};
  VerificationService verification{config};
  TouchService touching{devices, true};
  TrackerService tracker{devices, std::chrono::nanoseconds{0}};
  Hub hub{HubParts{.config = config,
                   .time = time,
                   .devices = devices,
                   .authority = authority,
                   .calibration = calibration,
                   .reference = &reference,
                   .touching = &touching,
                   .verification = &verification,
                   .tracker = &tracker}};

  /// What one input began does not outlive it.
  void end_all() {
    (void)calibration.cancel("fuzz", time.now());
    (void)calibration.cycle({}, time.now());
    (void)reference.cancel();
    (void)touching.cancel();
    touching.cycle({}, 0, "", std::chrono::steady_clock::now());
    tracker.cycle(time.now() + std::chrono::nanoseconds{1});
  }
};

json answer_to(const Daemon& daemon, std::string_view line, const ControlPeer& peer) {
  const auto request = parse_json(line, "request", kRequestBounds);
  if (!request) return refusal(request.error());
  if (!request->is_object()) return {{"ok", false}};
  try {
    return answer_on_hub(daemon.hub, *request, peer);
  } catch (const std::exception& wrong_type) {  // as the server answers it
    return {{"ok", false}, {"error", wrong_type.what()}};
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Daemon daemon;
  if (size == 0) return 0;
  const bool stranger = data[0] % 8 == 0;
  const ControlPeer peer{.user = "fuzz", .uid = stranger ? ::geteuid() + 1 : ::geteuid()};
  std::string_view rest{reinterpret_cast<const char*>(data) + 1, size - 1};

  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    const std::string answer = line_of(answer_to(daemon, rest.substr(0, end), peer));
    require(answer.find('\n') == answer.size() - 1);
    require(json::parse(answer).at("ok").is_boolean());
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }

  daemon.end_all();
  return 0;
}
