#pragma once
/// The main loop of the daemon. In every cycle, each `hub_period`, the hub empties the sample rings
/// of the devices and passes the samples to the live view, the publisher, the recorder and the
/// assembler, which passes snapshots to the calibration. The hub also sends a beat to abbe-dds
/// every 100 ms, so that abbe-dds detects a hung hub by missing beats.
///
/// Other threads run short tasks on the hub's thread through call(). A cycle takes no lock that an
/// ordinary thread may hold, and neither reads nor writes a disk.

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
#include "abbe/service/identity_watch.hpp"
#include "abbe/service/model_authority.hpp"
#include "abbe/service/reference_service.hpp"
#include "abbe/service/sensor_service.hpp"
#include "abbe/service/store_changes.hpp"
#include "abbe/service/touch_service.hpp"
#include "abbe/service/tracker_service.hpp"
#include "abbe/service/verification_service.hpp"

namespace abbe::daemon {

/// The objects that a cycle of the hub uses, owned by Abbed. `publisher` and the pointers declared
/// after it may be null.
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
  StoreChanges* store_changes = nullptr;
  /// The user as which abbe-dds runs. Because abbe-dds reads the network, this user has no role on
  /// the control socket.
  std::optional<uid_t> network_user = {};
  IdentityWatch* identity = nullptr;
  SensorService* sensors = nullptr;
  /// State of the sensor checks at the end of the earlier run; it was checked to be readable.
  std::optional<RecordingAttachment> sensor_state = {};
};

class Hub : private PipelineObserver {
 public:
  using WallTime = Publisher::WallTime;
  /// A hub that has not answered for this long, which is thousands of cycles, is regarded as
  /// hanging.
  static constexpr std::chrono::seconds kHangsAfter{1};

  explicit Hub(HubParts parts);
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  ~Hub() override;

  /// Runs one cycle. Only for the hub's thread.
  void cycle(WallTime wall);
  /// Runs a cycle every hub_period until stop() is called.
  void run();
  void stop() noexcept { stopping_ = true; }
  /// Wall time at which the last cycle began, for the watchdog. Any thread.
  [[nodiscard]] WallTime last_cycle() const noexcept;

  /// Runs `task` on the hub's thread in its next cycle and returns the result. May be called from
  /// any other thread. Returns nullopt if the hub does not start the task within `time_out`; the
  /// task is then not run later either. `task` must be short: parse requests before the call and
  /// format answers after it. Objects that `task` owns are destroyed on the calling thread.
  template <class Task>
  [[nodiscard]] auto call(Task task, std::chrono::milliseconds time_out)
      -> std::optional<std::invoke_result_t<Task&>> {
    std::optional<std::invoke_result_t<Task&>> result;
    if (!run_in_cycle([&] { result.emplace(task()); }, time_out)) return std::nullopt;
    return result;
  }

  /// May be called from any thread. The comments of the parts state which threads may use them.
  [[nodiscard]] const HubParts& parts() const noexcept { return parts_; }

  // The following functions may be called only by tasks on the hub's thread.
  [[nodiscard]] const LiveView& live() const noexcept { return live_; }
  [[nodiscard]] const std::vector<StreamHealth>& health() const noexcept { return health_; }
  [[nodiscard]] ActiveModelState model_state() const;

 private:
  struct Call;
  [[nodiscard]] bool run_in_cycle(std::function<void()> task, std::chrono::milliseconds time_out);
  void run_calls();
  void on_samples(const Batch& batch) override;
  void on_snapshots(std::span<const protocol::Snapshot> snapshots,
                    protocol::HostTime taken) override;
  void publish(bool fresh, protocol::HostTime now);
  void follow_identity(WallTime wall);
  void collect_health(protocol::HostTime now);
  void accept_sensors();
  void touch(std::size_t points_left, WallTime wall);

  HubParts parts_;
  Pipeline pipeline_;
  LiveView live_;
  std::string touches_by_;  // name of the device that delivers the touches
  Batch batch_;
  WallTime cycle_began_{};
  std::vector<StreamHealth> health_;
  std::string missing_scales_;  ///< LiveView::why_scales_alone_are_missing()
  WallTime next_health_{};
  std::atomic<std::int64_t> last_cycle_ns_{0};
  std::atomic<bool> stopping_{false};
  drivers::Mailbox<Call*> calls_;  // a call belongs to its caller until it has timed out
  // Calls whose caller timed out and that the hub has taken out of calls_; the next caller of
  // call() frees these calls.
  drivers::Mailbox<Call*> given_up_;
};

}  // namespace abbe::daemon
