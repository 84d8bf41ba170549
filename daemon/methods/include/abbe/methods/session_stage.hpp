#pragma once
/// The stages of a calibration session and every transition between them. Pure functions.

#include <array>
#include <cstdint>
#include <optional>

#include "abbe/pipeline/session_status.hpp"

namespace abbe::daemon {

/// The stages of a session. They are finer than SessionState, which is recorded, published and
/// shown.
enum class SessionStage : std::uint8_t {
  Idle,         ///< no session yet
  Warming,      ///< the run has not begun
  Acquiring,    ///< samples are added to the run
  Complete,     ///< the run is complete and waits for take_run()
  Identifying,  ///< the caller identifies the model
  Storing,      ///< the caller has an identified model with its verdict and stores it
  NotStored,    ///< the store returned an error; the caller tries again
  Judged,       ///< the model is stored; the verdict follows at once
  Active,       ///< ended: the gate accepted the model
  Refused,      ///< ended without an active model
  Ending,       ///< cancelled, but the identification still runs: no other session can start
};

/// The events that may change the stage of a session.
enum class SessionStep : std::uint8_t {
  Start,
  RunBegins,
  RunCompletes,
  RunFails,
  RunTaken,
  ModelIdentified,
  NoModel,  ///< no model was identified, or the session was cancelled before
  StoreFails,
  StoreAgain,
  ModelStored,
  VerdictPasses,
  VerdictFails,
  Cancel,
  GiveUpStore,  ///< cancel while the store does not answer
};

struct SessionTransition {
  SessionStage from;
  SessionStep step;
  SessionStage to;
};

/// All transitions. A step that has no row for the present stage changes nothing.
inline constexpr auto kSessionTransitions = [] {
  using enum SessionStage;
  using enum SessionStep;
  return std::to_array<SessionTransition>({
      {Idle, Start, Warming},
      {Active, Start, Warming},
      {Refused, Start, Warming},

      {Warming, RunBegins, Acquiring},
      {Warming, RunCompletes, Complete},
      {Warming, RunFails, Refused},
      {Warming, Cancel, Refused},

      {Acquiring, RunCompletes, Complete},
      {Acquiring, RunFails, Refused},
      {Acquiring, Cancel, Refused},

      {Complete, RunTaken, Identifying},
      {Complete, Cancel, Refused},

      {Identifying, ModelIdentified, Storing},
      {Identifying, NoModel, Refused},
      {Identifying, Cancel, Ending},
      {Ending, NoModel, Refused},

      {Storing, ModelStored, Judged},
      {Storing, StoreFails, NotStored},
      {Storing, GiveUpStore, Refused},

      {NotStored, StoreAgain, Storing},
      {NotStored, Cancel, Refused},

      {Judged, VerdictPasses, Active},
      {Judged, VerdictFails, Refused},
  });
}();

/// The stage after `step`; nullopt: the step is not possible in this stage.
[[nodiscard]] constexpr std::optional<SessionStage> next_stage(SessionStage stage,
                                                               SessionStep step) noexcept {
  for (const SessionTransition& row : kSessionTransitions)
    if (row.from == stage && row.step == step) return row.to;
  return std::nullopt;
}

/// The state that is published in a stage.
[[nodiscard]] constexpr SessionState state_of(SessionStage stage) noexcept {
  switch (stage) {
    case SessionStage::Idle:
      return SessionState::Idle;
    case SessionStage::Warming:
      return SessionState::Warming;
    case SessionStage::Acquiring:
      return SessionState::Acquiring;
    case SessionStage::Complete:
    case SessionStage::Identifying:
    case SessionStage::Storing:
    case SessionStage::NotStored:
      return SessionState::Identifying;
    case SessionStage::Judged:
      return SessionState::Judged;
    case SessionStage::Active:
      return SessionState::Active;
    case SessionStage::Refused:
    case SessionStage::Ending:
      return SessionState::Refused;
  }
  return SessionState::Refused;
}

/// True if the session has ended: its state is Active or Refused.
[[nodiscard]] constexpr bool has_ended(SessionStage stage) noexcept {
  const SessionState state = state_of(stage);
  return state == SessionState::Active || state == SessionState::Refused;
}

}  // namespace abbe::daemon
