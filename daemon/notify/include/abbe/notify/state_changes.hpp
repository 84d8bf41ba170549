#pragma once
/// Finds the events in a sequence of answers of abbed to "status". Each change is reported once,
/// also if abbed did not answer in between. Faults in the first answer are reported once. Other
/// states in the first answer are not reported: changes are counted from them. Not thread-safe;
/// reads no clock.

#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "abbe/base/daemon_poll.hpp"
#include "abbe/notify/event.hpp"

namespace abbe::notify {

class StateChanges {
 public:
  /// `settle`: time after the first answer of an abbed in which its devices connect. Faults are
  /// reported only if they are still present afterwards. The same time without an answer means that
  /// abbed is not reachable.
  explicit StateChanges(std::chrono::nanoseconds settle) : settle_(settle) {}

  [[nodiscard]] std::vector<Event> take(const daemon::DaemonPoll::Answer& answer, Moment now);

 private:
  using Steady = std::chrono::steady_clock::time_point;

  /// A state that lasts: a device without connection, a model that is not valid.
  struct Lasting {
    NotifyKind kind = NotifyKind::DeviceLost;
    Severity severity = Severity::Warning;
    /// a change of this member is reported again; a change of the text is not
    std::string state{};
    std::string text{};
    std::string model_id{};
  };
  using AllLasting = std::map<std::string, Lasting>;  ///< states by subject

  [[nodiscard]] std::vector<Event> answered(const nlohmann::json& status, Moment now);
  [[nodiscard]] std::vector<Event> away(const std::string& fault, Moment now);
  void see_process(const nlohmann::json& status, Moment now, std::vector<Event>& out);
  void see_ended_sessions(const nlohmann::json& status, std::vector<Event>& out);
  void see_demands(const nlohmann::json& status, std::vector<Event>& out);
  void see_lasting(const nlohmann::json& status, std::vector<Event>& out);
  [[nodiscard]] AllLasting lasting_in(const nlohmann::json& status);

  std::chrono::nanoseconds settle_;
  std::optional<int> process_;  ///< process id of the abbed that answered last
  bool first_answer_ = true;    ///< true: no answer has been evaluated since this object was made
  std::uint64_t last_session_ = 0;  ///< highest number of a calibration that has ended
  std::string demand_, release_;    ///< the last requests to a person
  bool had_model_ = false;
  AllLasting lasting_;  ///< states that were reported
  Steady settled_at_{};
  std::optional<Steady> away_since_;
  bool away_reported_ = false;
};

}  // namespace abbe::notify
