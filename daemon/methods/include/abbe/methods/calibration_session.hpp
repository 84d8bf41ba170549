#pragma once
/// One calibration from the command to the verdict, as an explicit state machine. Its inputs are
/// snapshots and the outcome of the identification, which the caller runs. It reads no clock and
/// starts no thread, so that a live run and its replay pass through the same states at the same
/// recorded instants.
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
/// The states are the same for every method; only the acquisition differs (OtfAcquisition,
/// EvemuAcquisition, MfbAcquisition). If the method guides the operator from touch to touch, each
/// new instruction is also an event. Not for the RT path; not thread-safe.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/base/axis_position.hpp"
#include "abbe/base/error.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

using Acquisition = Methods::Acquisition;

/// A checked task, ready to start. All work that depends on the size of the request is done.
struct PreparedSession {
  std::string_view method;
  Acquisition acquisition;
};

/// Converts a complete acquisition to the input of the identification. O(n) in points and vertices.
[[nodiscard]] CalibrationRun run_of(Acquisition acquired);

class CalibrationSession {  // NOLINT(bugprone-exception-escape): a defaulted move of a variant
 public:
  /// `options`: one element for each method, in the order of Methods.
  explicit CalibrationSession(Methods::Options options = {}) : options_(std::move(options)) {}

  /// Checks a task and makes it ready for start(). BadInput for an invalid task. May be called from
  /// any thread, also while another thread uses the session.
  [[nodiscard]] Result<PreparedSession> prepare(CalibrationTask task) const;
  /// Starts a session. Refused while another session is running. Afterwards `prepared` may hold
  /// data of the previous session; the caller destroys it.
  [[nodiscard]] Result<void> start(PreparedSession&& prepared, protocol::HostTime from);
  /// prepare() and start().
  [[nodiscard]] Result<void> start(CalibrationRequest request);
  /// Ends a running session as refused; what was acquired stays in the recording.
  [[nodiscard]] Result<void> cancel(std::string who, protocol::HostTime now);

  void take(const protocol::Snapshot& snapshot);
  /// Fails the acquisition if no samples arrive any more; `now` is host time. Called in a live run
  /// only: in a replay the run is incomplete without it and gives no model either.
  void tick(protocol::HostTime now);

  /// What was added to the run since the last call, for tables while the machine moves. nullopt:
  /// the session is not acquiring, or its method has no such tables. Has no influence on the
  /// session.
  [[nodiscard]] std::optional<RunNews> take_news();
  /// The acquired run, available in the state Identifying; nullopt in other states and after it was
  /// returned once.
  [[nodiscard]] std::optional<Acquisition> take_run();
  /// The acquisition of a refused session, returned once. The caller destroys it in the background,
  /// because destroying it may take long.
  [[nodiscard]] std::optional<Acquisition> take_discarded() {
    return std::exchange(discarded_, std::nullopt);
  }

  /// Report the outcome of the identification: a model was judged, or none could be identified.
  void judged(std::string model_id, bool passed, std::string reason, protocol::HostTime now);
  void not_identified(const Error& why, protocol::HostTime now);
  /// Reports that the identified model could not be stored so far. Adds an event whenever `reason`
  /// changes.
  void not_stored(std::string reason, protocol::HostTime now);

  [[nodiscard]] const SessionStatus& status() const noexcept { return status_; }
  [[nodiscard]] bool running() const noexcept;
  /// Events since the last call, in order of time.
  [[nodiscard]] std::vector<SessionEvent> take_events();

 private:
  [[nodiscard]] bool acquiring() const noexcept;
  void follow_acquisition(protocol::HostTime now);
  template <class Guided>
  void follow_guidance(Guided& acquisition, protocol::HostTime now);
  void enter(SessionState state, std::string reason, protocol::HostTime now);

  Methods::Options options_;
  std::optional<Acquisition> acquisition_, discarded_;
  std::uint64_t started_ = 0;  ///< number of sessions started
  SessionStatus status_;
  std::vector<SessionEvent> events_;
};

}  // namespace abbe::daemon
