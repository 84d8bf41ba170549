#pragma once
/// The state of the calibration sessions, in one place: stage, reason, method, number, request,
/// model, times, earlier sessions. Its inputs are snapshots and the outcome of the
/// identification, which the caller runs and reports. It reads no clock and starts no thread, so
/// that a live run and its replay pass through the same states at the same recorded instants.
///
///     idle --start--> warming --run begins--> acquiring --run complete--> identifying --+
///                        |                        |                            |        |
///                     cancel,                  cancel,                      cancel,     |
///                     failure                  failure                     no model     |
///                        v                        v                            v        |
///                     refused                  refused                      refused     |
///                                                                                       |
///          +------------------------------model identified------------------------------+
///          v
///       judged --gate passed--> active
///          |
///          +-----gate failed--> refused
///
/// These are the published states. session_stage.hpp has the table of all transitions, in which
/// "identifying" is four stages.
///
/// The states are the same for every method; only the acquisition differs (OtfAcquisition,
/// EvemuAcquisition, MfbAcquisition). If the method guides the operator from touch to touch, each
/// new instruction is also an event. Not for the RT path; not thread-safe.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/session_stage.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

using Acquisition = Methods::Acquisition;

/// A checked task, ready to start. All work that depends on the size of the request is done.
struct PreparedSession {
  std::string_view method;
  Acquisition acquisition;
  /// The request as JSON, for clients that show it
  std::shared_ptr<const std::string> request_text = {};
};

/// Converts a complete acquisition to the input of the identification. O(n) in points and vertices.
[[nodiscard]] CalibrationRun run_of(Acquisition acquired);

class CalibrationSession {  // NOLINT(bugprone-exception-escape): a defaulted move of a variant
 public:
  static constexpr std::size_t kEndedKept = 4;  ///< length of ended()

  /// `options`: one element for each method, in the order of Methods.
  explicit CalibrationSession(Methods::Options options = {}) : options_(std::move(options)) {}

  /// Checks a task and makes it ready for start(). BadInput for an invalid task. May be called from
  /// any thread, also while another thread uses the session.
  [[nodiscard]] Result<PreparedSession> prepare(CalibrationTask task) const;
  /// Starts a session for the user `who`. Refused while another session is running, or the
  /// identification of a cancelled one. Afterwards `prepared` may hold data of the previous
  /// session; the caller destroys it.
  [[nodiscard]] Result<void> start(PreparedSession&& prepared, std::string who,
                                   protocol::HostTime from);
  /// Calls prepare() and start() without a user, for a replay.
  [[nodiscard]] Result<void> start(CalibrationRequest request);
  /// Ends a running session as refused; what was acquired stays in the recording. Refused if there
  /// is no session, and while a model is being stored.
  [[nodiscard]] Result<void> cancel(std::string who, protocol::HostTime now);
  /// Same as cancel(), but for the time in which a model is being stored and the store does not
  /// answer.
  [[nodiscard]] Result<void> give_up_store(std::string who, protocol::HostTime now);

  void take(const protocol::Snapshot& snapshot);
  /// Fails the acquisition if no samples arrive any more; `now` is host time. Called in a live run
  /// only: in a replay the run is incomplete without it and gives no model either.
  void tick(protocol::HostTime now);

  /// The points and legs that were added to the run since the last call, for tables that are shown
  /// while the machine moves. nullopt: the session is not acquiring, or its method has no such
  /// tables. The call does not change the session.
  [[nodiscard]] std::optional<RunNews> take_news();
  /// The acquired run of a complete session, returned once; nullopt in other stages. The caller
  /// identifies the model and reports the outcome by the functions below.
  [[nodiscard]] std::optional<Acquisition> take_run();
  /// The acquisition of a refused session, returned once. The caller destroys it in the background,
  /// because destroying it may take long.
  [[nodiscard]] std::optional<Acquisition> take_discarded() {
    return std::exchange(discarded_, std::nullopt);
  }

  /// The identification gave no model. If the session was cancelled meanwhile, another session can
  /// now start.
  void not_identified(const Error& why, protocol::HostTime now);
  /// A model is identified and judged; the caller stores it.
  void identified(const calib::HeldOutFigures& held_out, protocol::HostTime now);
  /// The model could not be stored. `fault` states the cause, `advice` what the user can do. Adds
  /// an event whenever the text changes.
  void store_failed(std::string fault, std::string_view advice, protocol::HostTime now);
  /// The store does not answer. As store_failed(), but the caller still waits for the answer of the
  /// store.
  void store_stalls(std::string fault, std::string_view advice, protocol::HostTime now);
  /// Call it after store_failed(), when the caller stores the model again.
  void store_again(protocol::HostTime now) { (void)go(SessionStep::StoreAgain, now); }
  /// The model is stored with its verdict.
  void judged(std::string model_id, bool passed, std::string reason, SessionVerdict verdict,
              protocol::HostTime now);

  [[nodiscard]] SessionStage stage() const noexcept { return stage_; }
  /// Host time at which the stage began.
  [[nodiscard]] protocol::HostTime since() const noexcept { return since_; }
  [[nodiscard]] bool running() const noexcept {
    return stage_ != SessionStage::Idle && !has_ended(stage_);
  }
  [[nodiscard]] const SessionStatus& status() const noexcept { return status_; }
  /// The user who started the present or last session.
  [[nodiscard]] const std::string& who() const noexcept { return who_; }
  /// The request of the present or last session as JSON; null before the first.
  [[nodiscard]] const std::shared_ptr<const std::string>& request_text() const noexcept {
    return request_text_;
  }
  /// The last kEndedKept sessions before the present one, oldest first, so that a client can still
  /// read the verdict on its session.
  [[nodiscard]] const std::deque<SessionStatus>& ended() const noexcept { return ended_; }
  /// The reason why an identified model is not stored yet: "model 0123... is not stored: write ...:
  /// No space left on device". Empty: there is no such model.
  [[nodiscard]] const std::string& not_stored() const noexcept { return not_stored_; }
  /// Held-out residuals of the last identified model, also of an earlier session; nullopt before
  /// the first.
  [[nodiscard]] const std::optional<calib::HeldOutFigures>& held_out() const noexcept {
    return held_out_;
  }
  /// Events since the last call, in order of time.
  [[nodiscard]] std::vector<SessionEvent> take_events();

 private:
  [[nodiscard]] bool acquiring() const noexcept { return takes_readings(status_.state); }
  void follow_acquisition(protocol::HostTime now);
  template <class Guided>
  void follow_guidance(Guided& acquisition, protocol::HostTime now);
  void report_not_stored(std::string fault, std::string_view advice, protocol::HostTime now);
  bool go(SessionStep step, protocol::HostTime now);
  bool enter(SessionStep step, std::string reason, protocol::HostTime now);
  void add_event(std::string reason, protocol::HostTime now);

  Methods::Options options_;
  std::optional<Acquisition> acquisition_, discarded_;
  SessionStage stage_ = SessionStage::Idle;  ///< changed by go() only
  protocol::HostTime since_{};
  std::uint64_t started_ = 0;  ///< number of sessions started
  SessionStatus status_;
  std::string who_;
  std::shared_ptr<const std::string> request_text_;
  std::string not_stored_;
  std::optional<calib::HeldOutFigures> held_out_;
  std::deque<SessionStatus> ended_;
  std::vector<SessionEvent> events_;
};

}  // namespace abbe::daemon
