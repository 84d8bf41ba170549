#pragma once
/// Runs calibrations in the daemon: feeds the session, identifies and keeps the judged model in the
/// store on a thread of its own, and puts it in force if the gate accepted it. A model that the
/// store does not take (disk full, read-only, locked) stays in memory, is tried again every five
/// seconds and reported until it is stored or its session is cancelled; there is one at most,
/// because its session goes on. Used by the hub's thread only, but for prepare(); no call waits for
/// anything, and none does work that grows with path, points or model: that is done where a task is
/// prepared, where a run is identified, and where a model is stored.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/calibration_session.hpp"
#include "abbe/recording/recorder_thread.hpp"
#include "abbe/service/model_authority.hpp"

namespace abbe::daemon {

/// A task that was checked and is ready to start.
struct PreparedCalibration {
  PreparedSession session;
  RecordingAttachment attachment;  ///< of the recording
  MethodNeeds needs;
};

class CalibrationService {
 public:
  /// `recorder` may be null: nothing is recorded then, and models name no recording.
  CalibrationService(const Config& config, ModelAuthority& authority, RecorderThread* recorder,
                     protocol::UtcOffset utc);
  /// Stops a running identification, and tries once more to store a model that waits for the store.
  /// Takes kStopTimeout at most: what does not end until then is left running, with nothing of
  /// this object; see background_tasks_running(). A model that is lost is reported on stderr.
  ~CalibrationService();
  static constexpr std::chrono::seconds kStopTimeout{4};
  static constexpr std::chrono::seconds kLastTry{1};  ///< of kStopTimeout, for the store's lock
  static constexpr std::size_t kEndedKept = 4;
  CalibrationService(const CalibrationService&) = delete;
  CalibrationService& operator=(const CalibrationService&) = delete;

  /// Refused or BadInput for a task of which no calibration could come with this configuration. Any
  /// thread but the hub's.
  [[nodiscard]] Result<PreparedCalibration> prepare(CalibrationTask task) const;
  /// The id of the session. Refused while there is one. The caller destroys `prepared`.
  [[nodiscard]] Result<std::uint64_t> start(PreparedCalibration&& prepared, const std::string& who,
                                            protocol::HostTime now);
  /// Both, for who has no real-time thread.
  [[nodiscard]] Result<std::uint64_t> start(CalibrationTask task, const std::string& who,
                                            protocol::HostTime now);
  /// Refused without a session, and while the model is being put into a store that may still answer
  /// within kStoreTimeout of the authority. An identification is asked to stop; until it has, no
  /// other session starts. Discards a model that the store does not take; of a store that does not
  /// answer the session's reason says that the model may still come into it. It is not activated
  /// then, unless that had begun.
  [[nodiscard]] Result<void> cancel(const std::string& who, protocol::HostTime now);

  /// Every turn: new snapshots, and the outcome of what has ended on the other thread. Returns
  /// changes of state, in order.
  std::vector<SessionEvent> cycle(std::span<const protocol::Snapshot> snapshots,
                                  protocol::HostTime now);

  [[nodiscard]] SessionStatus status() const;
  /// The last kEndedKept sessions before this one, oldest first: whoever asked for one finds its
  /// verdict.
  [[nodiscard]] const std::deque<SessionStatus>& ended() const noexcept { return ended_; }
  /// Why an identified model is still in memory only: "model 0123...: write ...: No space left on
  /// device". Empty: there is none.
  [[nodiscard]] const std::string& not_stored() const noexcept { return not_stored_; }
  /// The verdict of the last identification, for people; none yet: nothing.
  [[nodiscard]] const std::optional<calib::HeldOutFigures>& held_out() const noexcept {
    return held_out_;
  }

 private:
  /// A judged model on its way into the store.
  struct ToKeep {
    std::string id;
    ModelDocument document;
    calib::Verdict verdict;
    StoreActor actor;
    std::atomic<bool> discarded{false};  ///< cancelled: not to be stored
  };
  /// Made where the run was identified; the hub adds who and when.
  struct Identified {
    std::shared_ptr<ToKeep> model;
    std::string recording_gap;
  };
  /// What the thread of an identification shares with this object, and outlives it with.
  struct Watch {
    std::atomic<double> share{0.0};
    std::atomic<bool> stopped{false};
  };
  using WallTime = std::chrono::steady_clock::time_point;
  [[nodiscard]] Result<void> check(const CalibrationTask& task) const;
  void begin_identification(Acquisition acquired);
  [[nodiscard]] bool sign(Result<Identified> identified, protocol::HostTime now);
  void keep(Result<Identified> identified, protocol::HostTime now);
  void discard_unstored();
  void begin_keeping(protocol::HostTime now);
  void report_stalled_store(protocol::HostTime now);
  [[nodiscard]] bool store_stalls(protocol::HostTime now) const;
  void conclude(Result<KeptModel> kept, protocol::HostTime now);
  void stop_identification(WallTime until);
  [[nodiscard]] Result<void> try_once_more(WallTime until);

  const Config& config_;
  std::shared_ptr<const Config> shared_config_;  // the same, for the threads of identifications
  ModelAuthority& authority_;
  RecorderThread* recorder_;
  protocol::UtcOffset utc_;
  CalibrationSession session_;
  std::string who_;
  std::future<Result<Identified>> identification_;
  std::shared_ptr<ToKeep> to_keep_;  // shared with the thread that stores it
  std::future<Result<KeptModel>> keeping_;
  protocol::HostTime keeping_from_{};
  protocol::HostTime keep_again_at_{};
  std::string not_stored_;
  std::uint64_t keeping_since_ = 0;  // revision of the authority when the keeping began
  calib::Verdict verdict_;           // of the model being kept
  bool active_left_out_ = false;     // it was made for another machine configuration
  std::shared_ptr<Watch> watch_ = std::make_shared<Watch>();  // of the last identification
  std::deque<SessionStatus> ended_;
  protocol::HostTime latest_cycle_{};
  std::optional<calib::HeldOutFigures> held_out_;
};

}  // namespace abbe::daemon
