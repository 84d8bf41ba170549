#pragma once
/// State of a calibration session, as recorded, published and shown. Pure data.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

enum class SessionState : std::uint8_t {
  Idle,
  Warming,
  Acquiring,
  Identifying,
  Judged,
  Active,
  Refused
};
[[nodiscard]] std::string_view name(SessionState state) noexcept;
/// True if a session in this state takes samples of the devices for its run.
[[nodiscard]] constexpr bool takes_readings(SessionState state) noexcept {
  return state == SessionState::Warming || state == SessionState::Acquiring;
}

/// A table of the model, as far as the run has determined it.
struct LiveTable {
  std::string name;          ///< "EXX", "EC0Y"
  bool is_angle = false;     ///< values in rad, else in m
  std::vector<double> at_m;  ///< nodes; empty: squareness, which has one value
  /// One element per node; NaN where the run does not determine the value yet.
  std::vector<double> value, u;

  [[nodiscard]] bool determined() const noexcept;  ///< true if every node is determined
};

/// The tables of a run that is not complete. u: standard uncertainty.
struct LiveTables {
  std::vector<LiveTable> tables;
  std::size_t samples = 0;  ///< tracker points used
  double variance_factor = 1.0;
};

/// A feature of a ball array at the position that is being touched.
struct FeatureToTouch {
  std::string on;           ///< "ball 3", "block 1"
  std::size_t touched = 0;  ///< points taken
  std::size_t points = 0;   ///< points planned
  /// Centre of a ball, or of the touched points of a block; nullopt: not known yet.
  std::optional<std::array<double, 3>> at_m{};
  /// Normal of the face of a block, towards the side that the calibrator states; nullopt: not known
  /// yet.
  std::optional<std::array<double, 3>> normal{};
};

/// The touch that a guided acquisition asks for.
struct RequestedTouch {
  /// number of the position of a ball array, counted from 1; 0: `measurement` names the position
  int position = 0;
  std::string measurement;  ///< name of the measurement, for a bar
  std::size_t place = 0;    ///< index of the position or measurement in the plan, from 0
  std::string on;           ///< the feature: "ball 3", "hole 4"
  std::size_t touched = 0;  ///< points taken on this feature
  std::size_t points = 0;   ///< points planned on this feature
  /// All features of the position in measuring order; null: not a ball array. Shared with replies
  /// that other threads write; never changed.
  std::shared_ptr<const std::vector<FeatureToTouch>> features{};
};

/// A condition that must hold before the machine may start the run.
struct StartCondition {
  std::string name;  ///< "tracker", "axes", "position", "standstill"
  bool met = false;
  std::string text;  ///< text: the condition holds, or what is missing
};

/// Whether the machine may start the run. Valid only while a run waits for its start.
struct StartState {
  bool ready = false;   ///< all conditions hold: the machine may start now
  bool missed = false;  ///< the machine has started too early
  std::vector<StartCondition> conditions;
};

/// The verdict of the gate on the model of a session, in sentences.
struct SessionVerdict {
  std::string figures;  ///< the held-out residuals
  /// reasons why the model is refused or not activated; empty: accepted
  std::vector<std::string> reasons;
  std::vector<std::string> notes;  ///< remarks that are no reasons against the model
};

struct SessionStatus {
  std::uint64_t id = 0;  ///< number of the session in this process, from 1; 0: none yet
  SessionState state = SessionState::Idle;
  std::string method = "otf";
  /// reason why the session is in this state, or the action that the operator must take now
  std::string reason;
  /// in state Refused: the kind of error, for the exit code of the client
  ErrorCode refused_as = ErrorCode::DataInsufficient;
  double progress = 0.0;  ///< progress of the work in this state, 0 to 1
  std::size_t points = 0;
  /// in state Acquiring: estimated time to the end of this state, in host time
  std::optional<std::chrono::nanoseconds> remaining{};
  std::optional<StartState> start{};  ///< set in state Warming of a run along a path
  /// Tables of the run so far; null: there are none yet. Shared with replies that other threads
  /// write; never changed.
  std::shared_ptr<const LiveTables> live{};
  /// set in states Active and Refused, if there is a model
  std::optional<SessionVerdict> verdict{};
  /// in state Refused: the command that identifies the recorded run again with other options;
  /// empty: nothing was identified, or the run is not recorded
  std::string again{};
  std::string model_id;                ///< the model of this session, active or refused
  std::optional<RequestedTouch> next;  ///< touch requested by a guided acquisition
  std::vector<std::string> notes;      ///< remarks on touches, the latest kMostNotes
  std::size_t noted = 0;               ///< number of all remarks of the session

  static constexpr std::size_t kMostNotes = 50;
};

/// A change of state, to be recorded and published.
struct SessionEvent {
  protocol::HostTime time{};
  SessionStatus status;
};

}  // namespace abbe::daemon
