#pragma once
/// What a subscriber did with the vectors of every machine, as in its stamped lines, and the
/// rounds of kills, stops and outages it is put through.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "process.hpp"

namespace abbe::test {

using HostNs = std::int64_t;  ///< of CLOCK_MONOTONIC

/// The record of one subscriber; filled by the thread that reads its lines.
class SubscriberRecord {
 public:
  /// `tolerance_ms`: of understated().
  explicit SubscriberRecord(double tolerance_ms) : tolerance_ms_(tolerance_ms) {}

  void take(const std::string& line);
  void forget();

  /// First line since `from` after which the machine counts as ended: not alive, or a state that is
  /// not ACTIVE.
  [[nodiscard]] HostNs dead_since(const std::string& machine, HostNs from) const;
  [[nodiscard]] HostNs last_apply(const std::string& machine) const;
  [[nodiscard]] double worst_understatement_ms() const;  ///< true age less the age it went by
  [[nodiscard]] std::uint64_t applied() const;
  /// Applied vectors whose age was understated by more than the tolerance.
  [[nodiscard]] std::uint64_t understated() const;

 private:
  struct OfMachine {
    std::vector<HostNs> dead;  // newest last
    HostNs last_apply = 0;
  };
  void note_apply(const std::string& machine, HostNs now, const char* text);

  const double tolerance_ms_;
  mutable std::mutex mutex_;
  std::map<std::string, OfMachine> machines_;
  double worst_ms_ = 0.0;
  std::uint64_t applied_ = 0, understated_ = 0;
};

/// What happened in all rounds so far.
struct LiveTruthFigures {
  int rounds = 0;
  double longest_hold_s = 0.0;  ///< of the state ACTIVE of a machine that has ended
  int held_too_long = 0;        ///< longer than 1.5 s
  double longest_return_s = 0.0;
  int orphaned = 0;  ///< subscribers that did not apply again within 10 s
  double worst_understatement_ms = 0.0;
  std::uint64_t applied = 0;
  std::uint64_t understated = 0;  ///< by more than LiveTruth::Parts::tolerance_ms
  std::vector<std::string> failures;
};

/// Two machines and two subscribers (Fast DDS, Cyclone DDS) on one domain. Used by one thread.
class LiveTruth {
 public:
  using StartMachine = std::function<std::unique_ptr<Process>(const std::string& name)>;
  enum class Blow { KillMachine, StopAbbed, StopAbbeDds, StopSubscriber, Outage };

  struct Parts {
    StartMachine start_machine;
    std::vector<std::string> fast_subscriber, cyclone_subscriber;  ///< commands
    bool has_network_of_its_own = false;                           ///< loopback may be switched off
    double tolerance_ms = 0.0;  ///< an age that is understated by more is counted
  };
  explicit LiveTruth(Parts parts);
  ~LiveTruth();

  /// False: the subscribers do not apply to begin with.
  [[nodiscard]] bool begin();
  void round(Blow blow, double seconds);
  void random_round(std::mt19937& random);
  [[nodiscard]] LiveTruthFigures figures() const;

 private:
  struct Subscriber;
  struct Machine;
  void strike(Blow blow, double seconds, const std::vector<Machine*>& dead);
  void expect_dead(const std::vector<Machine*>& dead, HostNs since, const std::string& what);
  void expect_all_apply(HostNs since, const std::string& what);
  [[nodiscard]] bool all_apply(HostNs since, double seconds);

  Parts parts_;
  std::vector<std::unique_ptr<Machine>> machines_;
  std::vector<std::unique_ptr<Subscriber>> subscribers_;
  LiveTruthFigures figures_;
};

/// Commands of the two example subscribers, which stamp their lines.
struct SubscriberCommands {
  std::vector<std::string> fast, cyclone;
};
/// `keys`: folder with those of subscriber-1 and subscriber-2; empty: without keys. `real_time`: at
/// SCHED_FIFO, so that other programs do not delay a subscriber between its decision and the stamp
/// of its line.
[[nodiscard]] SubscriberCommands subscriber_commands(const std::string& domain,
                                                     const std::filesystem::path& keys,
                                                     bool real_time);
/// True if this process may use SCHED_FIFO.
[[nodiscard]] bool real_time_permitted();

/// This thread and the processes it starts from now on have a network of their own, with loopback
/// up. False: not permitted.
[[nodiscard]] bool enter_own_network();
void switch_loopback(bool on);

}  // namespace abbe::test
