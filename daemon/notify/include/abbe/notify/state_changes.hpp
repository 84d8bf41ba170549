#pragma once
/// The events in a sequence of answers of abbed to "status". Each change is reported once, also if
/// abbed did not answer in between. What is wrong when the first answer arrives is reported once;
/// what else that answer contains is the state from which changes are counted.
/// Not thread-safe; reads no clock.

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
  /// `settle`: the time after the first answer of an abbed during which its devices connect; what
  /// is wrong is reported if it is still wrong afterwards. Also the time without an answer after
  /// which abbed is not reachable.
  explicit StateChanges(std::chrono::nanoseconds settle) : settle_(settle) {}

  [[nodiscard]] std::vector<Event> take(const daemon::DaemonPoll::Answer& answer, Moment now);

 private:
  using Steady = std::chrono::steady_clock::time_point;

  /// A state that lasts: a device without connection, a model that is not valid.
  struct Lasting {
    NotifyKind kind = NotifyKind::DeviceLost;
    Severity severity = Severity::Warning;
    std::string state{};  ///< another state is reported again, another text is not
    std::string text{};
    std::string model_id{};
  };
  using AllLasting = std::map<std::string, Lasting>;  ///< by subject

  [[nodiscard]] std::vector<Event> answered(const nlohmann::json& status, Moment now);
  [[nodiscard]] std::vector<Event> away(const std::string& fault, Moment now);
  void see_process(const nlohmann::json& status, Moment now, std::vector<Event>& out);
  void see_ended_sessions(const nlohmann::json& status, std::vector<Event>& out);
  void see_demands(const nlohmann::json& status, std::vector<Event>& out);
  void see_lasting(const nlohmann::json& status, std::vector<Event>& out);
  [[nodiscard]] AllLasting lasting_in(const nlohmann::json& status);

  std::chrono::nanoseconds settle_;
  std::optional<int> process_;      ///< of the abbed that answered last
  bool first_answer_ = true;        ///< of this StateChanges
  std::uint64_t last_session_ = 0;  ///< the highest number of a calibration that has ended
  std::string demand_, release_;    ///< what a person was last asked to do
  bool had_model_ = false;
  AllLasting lasting_;  ///< as reported
  Steady settled_at_{};
  std::optional<Steady> away_since_;
  bool away_reported_ = false;
};

}  // namespace abbe::notify
