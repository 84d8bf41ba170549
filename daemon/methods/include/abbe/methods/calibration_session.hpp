#pragma once
/// One calibration from the command to the verdict, as an explicit state machine. It is driven by
/// snapshots and by the outcome of the identification that somebody else runs; it reads no clock
/// and starts no thread, so live and replay go through the same states at the same recorded
/// instants.
///
///     idle ──start──▶ warming ──the run begins──▶ acquiring ──run complete──▶ identifying ──▶ judged
///     ──gate──▶ active
///                        │                            │                          │             │
///                        └────────────cancel, lost────┴──────data do not allow───┴───gate──────┴──▶ refused
///
/// The same for every method; what differs is the acquisition (OtfAcquisition, EvemuAcquisition).
/// Where people are guided from touch to touch, every new instruction is an event, too. Ordinary
/// world; not thread-safe.

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

/// A task that was checked and made ready to start: what grows with the request is done.
struct PreparedSession {
  std::string_view method;
  Acquisition acquisition;
};

/// What a session had acquired when the run was complete, as the input of the identification. O(n)
/// in points and vertices.
[[nodiscard]] CalibrationRun run_of(Acquisition acquired);

class CalibrationSession {  // NOLINT(bugprone-exception-escape): a defaulted move of a variant
 public:
  /// Options of every method, in the order of Methods.
  explicit CalibrationSession(Methods::Options options = {}) : options_(std::move(options)) {}

  /// BadInput for a task that is none. Any thread, also while another uses the session.
  [[nodiscard]] Result<PreparedSession> prepare(CalibrationTask task) const;
  /// Refused while a session is running. What the session before left is in `prepared` then:
  /// whoever prepared it destroys that, too.
  [[nodiscard]] Result<void> start(PreparedSession&& prepared, protocol::HostTime from);
  /// Both.
  [[nodiscard]] Result<void> start(CalibrationRequest request);
  /// Ends a running session as refused; what was acquired stays in the recording.
  [[nodiscard]] Result<void> cancel(std::string who, protocol::HostTime now);

  void take(const protocol::Snapshot& snapshot);
  /// Ends an acquisition that nothing arrives for any more; `now` is host time. Live only: see
  /// tick() of the acquisitions.
  void tick(protocol::HostTime now);

  /// The acquired run, once, when the state has become Identifying.
  [[nodiscard]] std::optional<Acquisition> take_run();
  /// What was acquired in vain, once, for whoever has the time to destroy it.
  [[nodiscard]] std::optional<Acquisition> take_discarded() {
    return std::exchange(discarded_, std::nullopt);
  }

  /// The identification is done: a model was judged, or the data did not allow one.
  void judged(std::string model_id, bool passed, std::string reason, protocol::HostTime now);
  void not_identified(const Error& why, protocol::HostTime now);
  /// A judged model waits for the store; an event whenever the reason changes.
  void not_stored(std::string reason, protocol::HostTime now);

  [[nodiscard]] const SessionStatus& status() const noexcept { return status_; }
  [[nodiscard]] bool running() const noexcept;
  /// Changes since the last call, in order.
  [[nodiscard]] std::vector<SessionEvent> take_events();

 private:
  [[nodiscard]] bool acquiring() const noexcept;
  void follow_acquisition(protocol::HostTime now);
  template <class Guided>
  void follow_guidance(Guided& acquisition, protocol::HostTime now);
  void enter(SessionState state, std::string reason, protocol::HostTime now);

  Methods::Options options_;
  std::optional<Acquisition> acquisition_, discarded_;
  std::uint64_t started_ = 0;  ///< how many sessions
  SessionStatus status_;
  std::vector<SessionEvent> events_;
};

}  // namespace abbe::daemon
