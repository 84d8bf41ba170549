#pragma once
/// The common part of the guided acquisitions of all methods with a touch probe: the touches of the
/// run, notes on them, and the conditions that end a run of any method. Decisions depend on
/// snapshots only; only pause() receives the time. Not for the RT path; not thread-safe.

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

struct TouchRules {
  std::string device = "probe";  ///< name of the probing device, for messages
  /// True: a restart of the device during the run ends the run, because the counters of a counter
  /// card then start again at 0 at the current position. False if all axes have reference marks,
  /// which give the same zero as before.
  bool zero_is_lost_by_restart = true;
  /// The run ends if no touch arrives for longer than this host time. The time is long because the
  /// operator turns and clamps the artefact by hand between positions.
  std::chrono::nanoseconds longest_pause = std::chrono::hours{1};
  /// A run that has no usable touch yet ends after this many unusable ones.
  std::size_t most_refused = 20;
};

class TouchIntake {
 public:
  explicit TouchIntake(TouchRules rules = {}) : rules_(std::move(rules)) {}

  /// Starts the run. Touches before `from` do not belong to it.
  void begin(protocol::HostTime from) noexcept { from_ = last_touch_ = from; }
  /// True if the touch belongs to the run.
  [[nodiscard]] bool is_of_run(const protocol::Snapshot& snapshot) noexcept;

  /// The reason why the run ends with this touch: its device has restarted. Empty: the run
  /// continues.
  [[nodiscard]] std::string lost_zero(const protocol::Snapshot& touch) const;
  /// Notes an unusable touch. If the run has no usable touch so far, returns the reason why it
  /// ends. Empty: the run continues.
  [[nodiscard]] std::string refuse(const protocol::Snapshot& touch, std::string_view fault,
                                   std::string_view expected);
  void usable(const protocol::Snapshot& touch) noexcept;
  /// Host times of the first and the last usable touch; nullopt if there is none.
  [[nodiscard]] const std::optional<std::array<protocol::HostTime, 2>>& observed() const noexcept {
    return observed_;
  }
  /// The reason why the run ends at `now`: no touch for too long. Empty: the run continues.
  [[nodiscard]] std::string pause(protocol::HostTime now) const;

  void note(const protocol::Snapshot& touch, std::string_view what);
  /// Notes since the last call.
  [[nodiscard]] std::vector<std::string> take_notes();

 private:
  TouchRules rules_;
  protocol::HostTime from_{}, last_touch_{};
  std::optional<std::array<protocol::HostTime, 2>> observed_;
  std::size_t refused_in_a_row_ = 0;
  std::vector<std::string> notes_;
};

}  // namespace abbe::daemon
