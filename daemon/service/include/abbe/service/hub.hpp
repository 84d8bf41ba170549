#pragma once
/// The loop of the ordinary world: every `hub_period` it empties the rings and hands what came to
/// the recorder, the assembler (and so to the calibration), the live view and the publisher. It
/// says "alive" to abbe-dds first thing in every turn, so that a hung hub falls silent. Other
/// threads reach it through call(). In a turn it takes no lock that an ordinary thread may hold,
/// and no disk is read or written.

#include <atomic>
#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "abbe/drivers/mailbox.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/live_view.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/pipeline/sample_source.hpp"
#include "abbe/pipeline/stream_health.hpp"
#include "abbe/publishing/publisher.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "abbe/service/calibration_service.hpp"
#include "abbe/service/model_authority.hpp"
#include "abbe/service/reference_service.hpp"
#include "abbe/service/touch_service.hpp"
#include "abbe/service/tracker_service.hpp"
#include "abbe/service/verification_service.hpp"

namespace abbe::daemon {

/// Everything the hub's turn works on. Owned by abbed; `publisher`, `recorder` and the services
/// behind them may be null.
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
  TrackerService* tracker = nullptr;
};

class Hub : private PipelineObserver {
 public:
  using WallTime = Publisher::WallTime;

  explicit Hub(HubParts parts);
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  ~Hub() override;

  /// One turn; the hub's thread.
  void cycle(WallTime wall);
  /// Turns every hub_period until stop() is called.
  void run();
  void stop() noexcept { stopping_ = true; }
  /// Wall time at which the last turn began; any thread. The watchdog looks at it.
  [[nodiscard]] WallTime last_cycle() const noexcept;

  /// Runs `task` on the hub's thread at its next turn and gives back its result; from any other
  /// thread. Nothing if the hub does not get round to it in `time_out`; it never runs then. What
  /// `task` holds is destroyed on the calling thread. It is to be short: parse before, format
  /// after.
  template <class Task>
  [[nodiscard]] auto call(Task task, std::chrono::milliseconds time_out)
      -> std::optional<std::invoke_result_t<Task&>> {
    std::optional<std::invoke_result_t<Task&>> result;
    if (!run_in_cycle([&] { result.emplace(task()); }, time_out)) return std::nullopt;
    return result;
  }

  // For tasks that run on the hub's thread.
  [[nodiscard]] const LiveView& live() const noexcept { return live_; }
  [[nodiscard]] const std::vector<StreamHealth>& health() const noexcept { return health_; }
  [[nodiscard]] ModelStanding standing() const;
  [[nodiscard]] const HubParts& parts() const noexcept { return parts_; }

 private:
  struct Call;
  [[nodiscard]] bool run_in_cycle(std::function<void()> task, std::chrono::milliseconds time_out);
  void run_calls();
  void on_samples(const Batch& batch) override;
  void on_snapshots(std::span<const protocol::Snapshot> snapshots,
                    protocol::HostTime taken) override;
  void publish(bool fresh, protocol::HostTime now);
  void collect_health(protocol::HostTime now);
  void touch(std::size_t points_left, WallTime wall);

  HubParts parts_;
  Pipeline pipeline_;
  LiveView live_;
  std::string touches_by_;  // the device that delivers the touches
  Batch batch_;
  WallTime cycle_began_{};
  std::vector<StreamHealth> health_;
  WallTime next_health_{};
  std::atomic<std::int64_t> last_cycle_ns_{0};
  std::atomic<bool> stopping_{false};
  drivers::Mailbox<Call*> calls_;     // owned by who calls, unless given up
  drivers::Mailbox<Call*> given_up_;  // by callers, seen by the hub: freed by the next caller
};

}  // namespace abbe::daemon
