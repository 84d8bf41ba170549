#pragma once
/// One calibration from the command to the verdict, as an explicit state machine. It is driven by snapshots
/// and by the outcome of the identification that somebody else runs; it reads no clock and starts no thread,
/// so live and replay go through the same states at the same recorded instants.
///
///     idle ──start──▶ warming ──the run begins──▶ acquiring ──run complete──▶ identifying ──▶ judged
///     ──gate──▶ active
///                        │                            │                          │             │
///                        └────────────cancel, lost────┴──────data do not allow───┴───gate──────┴──▶ refused
///
/// The same for every method; what differs is the acquisition (OtfAcquisition, EvemuAcquisition). Where
/// people are guided from touch to touch, every new instruction is an event, too. Ordinary world; not
/// thread-safe.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "abbe/daemon/calibration_request.hpp"
#include "abbe/daemon/calibration_run.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

enum class SessionState : std::uint8_t { Idle, Warming, Acquiring, Identifying, Judged, Active, Refused };
[[nodiscard]] std::string_view name(SessionState state) noexcept;

struct SessionStatus {
  SessionState state = SessionState::Idle;
  std::string method = "otf";
  std::string reason;                                  ///< why it is in this state, or what to do now
  ErrorCode refused_as = ErrorCode::DataInsufficient;  ///< Refused: by what, for the exit code of who asked
  double progress = 0.0;                               ///< 0 to 1 of what the state is busy with
  std::size_t points = 0;
  std::string model_id;                         ///< of the model this session ended in, active or refused
  std::optional<calib::evemu::NextTouch> next;  ///< of a guided acquisition
  std::vector<std::string> notes;               ///< what was noticed, the latest kMostNotes
  std::size_t noted = 0;                        ///< how many there were

  static constexpr std::size_t kMostNotes = 50;
};

/// A change of state, to be recorded and published.
struct SessionEvent {
  protocol::HostTime time{};
  SessionStatus status;
};

class CalibrationSession {  // NOLINT(bugprone-exception-escape): a defaulted move of a variant
 public:
  explicit CalibrationSession(AcquisitionOptions otf = {}, EvemuAcquisitionOptions evemu = {})
      : otf_options_(std::move(otf)), evemu_options_(std::move(evemu)) {}

  /// Refused while a session is running; BadInput for a task that is none.
  [[nodiscard]] Result<void> start(CalibrationRequest request);
  /// Ends a running session as refused; what was acquired stays in the recording.
  [[nodiscard]] Result<void> cancel(std::string who, protocol::HostTime now);

  void take(const protocol::Snapshot& snapshot);
  /// Ends an acquisition that nothing arrives for any more; `now` is host time. Live only: see
  /// tick() of the acquisitions.
  void tick(protocol::HostTime now);

  /// The acquired run, once, when the state has become Identifying.
  [[nodiscard]] std::optional<CalibrationRun> take_run();

  /// The identification is done: a model was judged, or the data did not allow one.
  void judged(std::string model_id, bool passed, std::string reason, protocol::HostTime now);
  void not_identified(const Error& why, protocol::HostTime now);

  [[nodiscard]] const SessionStatus& status() const noexcept { return status_; }
  [[nodiscard]] bool running() const noexcept;
  /// Changes since the last call, in order.
  [[nodiscard]] std::vector<SessionEvent> take_events();

 private:
  using Acquisition = std::variant<OtfAcquisition, EvemuAcquisition>;

  [[nodiscard]] Result<Acquisition> acquisition(const CalibrationRequest& request) const;
  [[nodiscard]] bool acquiring() const noexcept;
  void follow_acquisition(protocol::HostTime now);
  void follow_guidance(EvemuAcquisition& touching, protocol::HostTime now);
  void enter(SessionState state, std::string reason, protocol::HostTime now);

  AcquisitionOptions otf_options_;
  EvemuAcquisitionOptions evemu_options_;
  std::vector<AxisPosition> path_m_;  ///< of an on-the-fly run
  std::optional<Acquisition> acquisition_;
  SessionStatus status_;
  std::vector<SessionEvent> events_;
};

}  // namespace abbe::daemon
