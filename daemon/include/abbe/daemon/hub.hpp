#pragma once
/// The loop of the ordinary world: every `hub_period` it empties the rings and hands what came to the
/// recorder, the assembler (and so to the calibration), the live view and the publisher. It says "alive" to
/// abbe-dds first thing in every turn, so that a hung hub falls silent. Other threads reach it through
/// call().

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "abbe/daemon/assembler.hpp"
#include "abbe/daemon/calibration_service.hpp"
#include "abbe/daemon/live_view.hpp"
#include "abbe/daemon/model_authority.hpp"
#include "abbe/daemon/publisher.hpp"
#include "abbe/daemon/recorder_thread.hpp"
#include "abbe/daemon/reference_service.hpp"
#include "abbe/daemon/sample_source.hpp"
#include "abbe/daemon/touch_service.hpp"
#include "abbe/daemon/verification_service.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::daemon {

/// Everything the hub's turn works on. Owned by abbed; `publisher`, `recorder` and the services behind them
/// may be null.
struct HubParts {
  const Config& config;
  const drivers::TimeSource& time;
  SampleSource& devices;
  ModelAuthority& authority;
  CalibrationService& calibration;
  Publisher* publisher = nullptr;
  RecorderThread* recorder = nullptr;
  ReferenceService* reference = nullptr;
  TouchService* touching = nullptr;
  VerificationService* verification = nullptr;
};

class Hub {
 public:
  using WallTime = Publisher::WallTime;

  explicit Hub(HubParts parts);

  /// One turn; the hub's thread.
  void turn(WallTime wall);
  /// Turns every hub_period until stop() is called.
  void run();
  void stop() noexcept { stopping_ = true; }
  /// Wall time at which the last turn began; any thread. The watchdog looks at it.
  [[nodiscard]] WallTime last_turn() const noexcept;

  /// Runs `task` on the hub's thread at its next turn and gives back its result; from any other thread.
  /// Nothing if the hub does not get round to it in `time_out`; it never runs then.
  [[nodiscard]] std::optional<nlohmann::json> call(std::function<nlohmann::json()> task,
                                                   std::chrono::milliseconds time_out);

  // For tasks that run on the hub's thread.
  [[nodiscard]] const LiveView& live() const noexcept { return live_; }
  [[nodiscard]] const std::vector<StreamHealth>& health() const noexcept { return health_; }
  [[nodiscard]] ModelStanding standing() const;
  [[nodiscard]] const HubParts& parts() const noexcept { return parts_; }

 private:
  struct Call;
  void run_calls();
  void publish(bool fresh, protocol::HostTime now, WallTime wall);
  void collect_health(protocol::HostTime now);
  void touch(std::size_t points_left, WallTime wall);

  HubParts parts_;
  Assembler assembler_;
  LiveView live_;
  Batch batch_;
  std::vector<protocol::Snapshot> snapshots_;
  std::vector<StreamHealth> health_;
  WallTime next_health_{};
  std::atomic<std::int64_t> last_turn_ns_{0};
  std::atomic<bool> stopping_{false};
  std::mutex calls_mutex_;
  std::vector<std::shared_ptr<Call>> calls_;  // under calls_mutex_
};

}  // namespace abbe::daemon
