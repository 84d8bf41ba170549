#pragma once
/// One calibration from the command to the verdict, as an explicit state machine. It is driven by snapshots
/// and by the outcome of the identification that somebody else runs; it reads no clock and starts no thread,
/// so live and replay go through the same states at the same recorded instants.
///
///     idle ──start──▶ warming ──the run begins──▶ acquiring ──path driven──▶ identifying ──▶ judged
///     ──gate──▶ active
///                        │                            │                          │             │
///                        └────────────cancel, lost────┴──────data do not allow───┴───gate──────┴──▶ refused
///
/// Ordinary world; not thread-safe.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/daemon/error.hpp"
#include "abbe/daemon/otf_acquisition.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

enum class SessionState : std::uint8_t { Idle, Warming, Acquiring, Identifying, Judged, Active, Refused };
[[nodiscard]] std::string_view name(SessionState state) noexcept;

struct SessionStatus {
  SessionState state = SessionState::Idle;
  std::string reason;
  double progress = 0.0;  ///< 0 to 1 of what the state is busy with
  std::size_t points = 0;
  std::string model_id;  ///< of the model this session ended in, active or refused
};

/// A change of state, to be recorded and published.
struct SessionEvent {
  protocol::HostTime time{};
  SessionStatus status;
};

class CalibrationSession {
 public:
  explicit CalibrationSession(AcquisitionOptions acquisition = {}) : acquisition_options_(acquisition) {}

  /// Begins an on-the-fly run along `path_m`. `from`: snapshots before this instant do not belong to it.
  /// Error::Refused while a session is running.
  [[nodiscard]] Result<void> start(std::vector<AxisPosition> path_m, protocol::HostTime from);
  /// Ends a running session as refused; what was acquired stays in the recording.
  [[nodiscard]] Result<void> cancel(std::string who, protocol::HostTime now);

  void take(const protocol::Snapshot& snapshot);
  /// Ends an acquisition that nothing arrives for any more; `now` is host time. Live only: see
  /// OtfAcquisition::tick().
  void tick(protocol::HostTime now);

  /// The acquired run, once, when the state has become Identifying.
  [[nodiscard]] std::optional<std::vector<RunPoint>> take_run();

  /// The identification is done: a model was judged, or the data did not allow one.
  void judged(std::string model_id, bool passed, std::string reason, protocol::HostTime now);
  void not_identified(std::string reason, protocol::HostTime now);

  [[nodiscard]] const SessionStatus& status() const noexcept { return status_; }
  [[nodiscard]] bool running() const noexcept;
  [[nodiscard]] const std::vector<AxisPosition>& path_m() const noexcept { return path_m_; }
  /// Changes since the last call, in order.
  [[nodiscard]] std::vector<SessionEvent> take_events();

 private:
  void follow_acquisition(protocol::HostTime now);
  void enter(SessionState state, std::string reason, protocol::HostTime now);

  AcquisitionOptions acquisition_options_;
  std::vector<AxisPosition> path_m_;
  std::optional<OtfAcquisition> acquisition_;
  SessionStatus status_;
  std::vector<SessionEvent> events_;
};

}  // namespace abbe::daemon
