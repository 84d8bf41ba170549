#pragma once
/// Runs calibrations in the daemon: feeds the session, identifies and keeps the judged model in the store on
/// a thread of its own, and puts it in force if the gate accepted it. Used by the hub's thread only; no call
/// waits for anything.

#include <atomic>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/daemon/calibration_request.hpp"
#include "abbe/daemon/calibration_session.hpp"
#include "abbe/daemon/model_authority.hpp"
#include "abbe/daemon/recorder_thread.hpp"

namespace abbe::daemon {

class CalibrationService {
 public:
  /// `recorder` may be null: nothing is recorded then, and models name no recording.
  CalibrationService(const Config& config, ModelAuthority& authority, RecorderThread* recorder,
                     protocol::UtcOffset utc);
  ~CalibrationService();  ///< waits for a running identification or store
  CalibrationService(const CalibrationService&) = delete;
  CalibrationService& operator=(const CalibrationService&) = delete;

  /// Refused or BadInput for a task of which no calibration could come with this configuration.
  [[nodiscard]] Result<void> start(CalibrationTask task, const std::string& who, protocol::HostTime now);
  /// Refused without a session, and while the model is being put into the store.
  [[nodiscard]] Result<void> cancel(const std::string& who, protocol::HostTime now);

  /// Every turn: new snapshots, and the outcome of what has ended on the other thread. Returns changes of
  /// state, in order.
  std::vector<SessionEvent> turn(std::span<const protocol::Snapshot> snapshots, protocol::HostTime now);

  [[nodiscard]] SessionStatus status() const;
  /// The verdict of the last identification, for people; none yet: nothing.
  [[nodiscard]] const std::optional<calib::HeldOutFigures>& held_out() const noexcept { return held_out_; }

 private:
  struct Identified {
    Candidate candidate;
    std::vector<InputFile> inputs;
  };
  [[nodiscard]] Result<void> check(const CalibrationTask& task) const;
  void begin_identification(CalibrationRun run);
  void keep(Result<Identified> identified, protocol::HostTime now);
  void conclude(Result<KeptModel> kept, protocol::HostTime now);

  const Config& config_;
  ModelAuthority& authority_;
  RecorderThread* recorder_;
  protocol::UtcOffset utc_;
  CalibrationSession session_;
  std::string who_;
  std::future<Result<Identified>> identification_;
  std::future<Result<KeptModel>> keeping_;
  std::uint64_t keeping_since_ = 0;  // revision of the authority when the keeping began
  calib::Verdict verdict_;           // of the model being kept
  bool active_left_out_ = false;     // it was made for another machine configuration
  std::atomic<double> identified_share_{0.0};
  std::optional<calib::HeldOutFigures> held_out_;
};

}  // namespace abbe::daemon
