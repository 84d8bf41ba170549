#pragma once
/// Compares successive states of the daemon's parts and gives one journal entry for each change.
/// Parts: devices, stops of a measuring machine, recorder, model store, DDS link, session, model,
/// abbe-dds and the hub. Reads no clock and writes nothing. The rate is limited: each part may have
/// kBurst entries at once, then one entry per kRefill, with the number of changes that were not
/// logged.

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/journal.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/pipeline/stream_health.hpp"
#include "abbe/publishing/publisher.hpp"

namespace abbe::daemon {

/// abbe-dds as a child of abbed.
struct ObservedParticipant {
  std::uint64_t restarts = 0;
  std::string last_end;     ///< "signal 9 (Killed) at 2026-11-22T16:58:22Z"; empty: none
  std::string start_fault;  ///< reason why abbe-dds cannot be started; empty: no fault
};

struct ObservedModel {
  std::string state;  ///< "ACTIVE"
  std::string id;
  std::string reason;
};

/// The latest request to stop the measuring machine.
struct ObservedStop {
  std::uint64_t number = 0;
  std::string outcome;  ///< "stopped"
  std::string text;
  bool confirmed = false;
};

struct Observed {
  bool hub_answers = true;  ///< false: streams, session and model are not known
  std::vector<StreamHealth> streams;
  SessionStatus session;
  ObservedModel model;
  std::optional<ObservedStop> stop = {};  ///< set once the outcome of the stop is known
  std::optional<ObservedParticipant> participant = {};
};

struct ObservedPart;  ///< state of one part at one time

class StateObserver {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr double kBurst = 5.0;
  static constexpr std::chrono::seconds kRefill{10};
  static constexpr std::chrono::seconds kCountPeriod{
      60};  ///< shortest period of entries that report only an increased count

  explicit StateObserver(std::string machine) : machine_(std::move(machine)) {}

  [[nodiscard]] std::vector<JournalEntry> look(const Observed& now, WallTime wall);

 private:
  struct Reported {
    std::string logged = {}, seen = {};  // state of the part: last logged, last observed
    std::uint64_t counted = 0;           // faults and losses at the last entry
    std::uint64_t suppressed = 0;        // changes since the last entry, not logged
    double lines_left = kBurst;
    WallTime refilled_at{}, logged_at{};
  };
  [[nodiscard]] std::optional<JournalEntry> compare(const ObservedPart& part, WallTime wall);

  std::string machine_;
  std::map<std::string, Reported, std::less<>> reported_;
};

}  // namespace abbe::daemon
