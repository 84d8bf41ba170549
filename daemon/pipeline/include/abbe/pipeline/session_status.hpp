#pragma once
/// What a calibration session is in, as it is recorded, published and shown. Pure data.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/evemu/touch_guide.hpp"
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
/// Whatever devices measure now may belong to the run.
[[nodiscard]] constexpr bool takes_readings(SessionState state) noexcept {
  return state == SessionState::Warming || state == SessionState::Acquiring;
}

struct SessionStatus {
  std::uint64_t id = 0;  ///< counts the sessions of this process from 1; 0: none yet
  SessionState state = SessionState::Idle;
  std::string method = "otf";
  std::string reason;  ///< why it is in this state, or what to do now
  /// Refused: by what, for the exit code of who asked
  ErrorCode refused_as = ErrorCode::DataInsufficient;
  double progress = 0.0;  ///< 0 to 1 of what the state is busy with
  std::size_t points = 0;
  std::string model_id;  ///< of the model this session ended in, active or refused
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

}  // namespace abbe::daemon
