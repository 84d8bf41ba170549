#pragma once
/// Runs calibrations in the daemon: passes snapshots to the session and reports the outcome of the
/// identification to it. One background task identifies the model, stores it with its verdict,
/// activates it if the gate accepted it, and encodes it for publication. The state of the
/// calibration is in CalibrationSession; this class owns only the background task and its model.
///
/// A model that cannot be stored (disk full, read-only, locked) stays in memory. Storing is tried
/// again every five seconds, and the fault is reported, until the model is stored or its session is
/// cancelled. There is at most one such model, because its session lasts until then.
///
/// Used by the hub's thread only, except prepare(). No call waits, and no call of the hub's thread
/// takes longer for a longer path, more points or a larger model: such work is done in prepare()
/// and in the background task.

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/end_limits.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/calibration_session.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "abbe/service/live_tables_watch.hpp"
#include "abbe/service/model_authority.hpp"

namespace abbe::daemon {

class IdentificationLink;
struct JudgedModel;

/// A calibration task that is checked and ready to start.
struct PreparedCalibration {
  PreparedSession session;
  RecordingAttachment attachment;  ///< the request, for the recording
  MethodNeeds needs;
};

class CalibrationService {
 public:
  /// `recorder` may be null: then nothing is recorded, and a model names no recording.
  CalibrationService(const Config& config, ModelAuthority& authority, RecorderThread* recorder,
                     WallClock clock = {});
  /// Stops a running identification, and tries once more to store a model that is not stored yet.
  /// Takes kStopTimeout at most. A background task that is still running then continues without
  /// access to this object; see background_tasks_running(). A lost model is reported on stderr.
  ~CalibrationService();
  static constexpr std::chrono::seconds kStopTimeout = kLongestWorkEnd;
  /// The part of kStopTimeout for which the last attempt to store a model waits for the lock of the
  /// store.
  static constexpr std::chrono::seconds kLastTry{1};
  CalibrationService(const CalibrationService&) = delete;
  CalibrationService& operator=(const CalibrationService&) = delete;

  /// Checks a task and makes it ready for start(). Refused or BadInput if no calibration is
  /// possible with this task and this configuration. May be called from any thread except the
  /// hub's.
  [[nodiscard]] Result<PreparedCalibration> prepare(CalibrationTask task) const;
  /// Starts a session and returns its id. Refused while another session runs. Afterwards `prepared`
  /// may contain data of the previous session; the caller destroys it.
  [[nodiscard]] Result<std::uint64_t> start(PreparedCalibration&& prepared, const std::string& who,
                                            protocol::HostTime now);
  /// Calls prepare() and start(), for callers without a real-time thread.
  [[nodiscard]] Result<std::uint64_t> start(CalibrationTask task, const std::string& who,
                                            protocol::HostTime now);
  /// Cancels the session.
  /// - Refused without a session, and while the model is being stored, unless the store has not
  ///   answered for ModelAuthority::kStoreTimeout.
  /// - A running identification gets a request to stop. Until it ends, no other session starts.
  /// - A model that could not be stored is discarded.
  /// - If the store does not answer, the reason of the session states that the store may still take
  ///   the model. That model is not activated, unless its activation had already begun.
  [[nodiscard]] Result<void> cancel(const std::string& who, protocol::HostTime now);

  /// Call in every cycle. Takes the new snapshots and the results of finished background tasks.
  /// Returns the changes of state, in order.
  std::vector<SessionEvent> cycle(std::span<const protocol::Snapshot> snapshots,
                                  protocol::HostTime now);

  /// The state of the calibration.
  [[nodiscard]] const CalibrationSession& session() const noexcept { return session_; }
  /// CalibrationSession::status() with what the background tasks have reached: the progress of the
  /// identification, and the tables of the run so far.
  [[nodiscard]] SessionStatus status() const;
  /// The file name of the recording with the run of the session, once it was identified, with
  /// whatever verdict; empty before, and without a recording.
  [[nodiscard]] std::string recording_of_run() const;
  /// The source of dates. Any thread.
  [[nodiscard]] const WallClock& clock() const noexcept { return clock_; }

 private:
  using WallTime = std::chrono::steady_clock::time_point;
  [[nodiscard]] Result<void> check(const CalibrationTask& task) const;
  void begin_identification(Acquisition acquired, protocol::HostTime now);
  void follow_background(protocol::HostTime now);
  bool take_model(protocol::HostTime now);
  [[nodiscard]] std::string identify_again() const;
  void conclude(Result<KeptModel> kept, protocol::HostTime now);
  void store_in_background(ModelKeeper keeper, protocol::HostTime now);
  void discard_model();
  void report_stalled_store(protocol::HostTime now);
  [[nodiscard]] bool store_stalls(protocol::HostTime now) const;
  [[nodiscard]] Result<void> store_before_end(WallTime until);

  const Config& config_;
  std::shared_ptr<const Config> shared_config_;  // copy, for the threads of identifications
  ModelAuthority& authority_;
  RecorderThread* recorder_;
  WallClock clock_;
  CalibrationSession session_;
  LiveTablesWatch live_tables_;
  std::future<Result<KeptModel>> task_;        // identifies and stores, or stores again
  std::shared_ptr<IdentificationLink> link_;   // with the last identification
  std::shared_ptr<JudgedModel> model_;         // to be stored; shared with the storing thread
  std::uint64_t revision_before_storing_ = 0;  // of the authority
  std::string again_;                          // identifies the last identified run again
  std::string again_from_;                     // the name of its recording
  std::uint64_t again_of_ = 0;                 // the session of that run
};

}  // namespace abbe::daemon
