#pragma once
/// Turns what the daemon's parts are in, looked at again and again, into one journal entry a
/// change: devices, recorder, model store, link, session, model, abbe-dds, the hub itself. It reads
/// no clock and writes nothing. A part that changes more often than kBurst times gets one line in
/// kRefill, with the count of changes that were left out.

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
  std::string last_end;     ///< "signal 9 (Killed) at 2026-11-22T16:58:22Z"; empty: never
  std::string start_fault;  ///< why it cannot be started; empty: it runs, or will
};

struct ObservedModel {
  std::string state;  ///< "ACTIVE"
  std::string id;
  std::string reason;
};

struct Observed {
  bool hub_answers = true;  ///< false: streams, session and model are not known
  std::vector<StreamHealth> streams;
  SessionStatus session;
  ObservedModel model;
  std::optional<ObservedParticipant> participant;
};

struct ObservedPart;  ///< one of them at one moment

class StateObserver {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr double kBurst = 5.0;
  static constexpr std::chrono::seconds kRefill{10};
  static constexpr std::chrono::seconds kCountPeriod{
      60};  ///< of lines that only say that a count has grown

  explicit StateObserver(std::string machine) : machine_(std::move(machine)) {}

  [[nodiscard]] std::vector<JournalEntry> look(const Observed& now, WallTime wall);

 private:
  struct Reported {
    std::string logged = {}, seen = {};  // what the part was in: last logged, last looked at
    std::uint64_t counted = 0;           // faults and losses, when last logged
    std::uint64_t suppressed = 0;        // changes since that were not logged
    double lines_left = kBurst;
    WallTime refilled_at{}, logged_at{};
  };
  [[nodiscard]] std::optional<JournalEntry> compare(const ObservedPart& part, WallTime wall);

  std::string machine_;
  std::map<std::string, Reported, std::less<>> reported_;
};

}  // namespace abbe::daemon
