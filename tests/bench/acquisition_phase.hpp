#pragma once
/// What the acquisition threads of abbed did in a phase of a run: the histogram of the time in
/// receive(), their scheduling delay (from the time a thread can run, because data arrived or a
/// time-out ended, to the time it runs) and the data that were lost. Counters that only increase;
/// their differences belong to a phase. Not contained: the time from the arrival of a packet in the
/// kernel to the wake-up of the thread.

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "hung_hub.hpp"

namespace abbe::bench {

/// Counts of durations by the upper bound of their bucket [s].
using CountsOfBuckets = std::map<double, std::uint64_t>;

inline double quantile_us(const CountsOfBuckets& histogram, double share) {
  std::uint64_t total = 0, seen = 0;
  for (const auto& [bound_s, count] : histogram) total += count;
  for (const auto& [bound_s, count] : histogram) {
    seen += count;
    if (static_cast<double>(seen) >= share * static_cast<double>(total)) return 1e6 * bound_s;
  }
  return 0.0;
}

/// Of one thread.
struct AcquisitionPhase {
  CountsOfBuckets receive;
  std::uint64_t delay_ns = 0;   ///< sum of the scheduling delays
  std::uint64_t scheduled = 0;  ///< how often the thread was scheduled; 0: the kernel has no data
  std::uint64_t lost = 0;       ///< gaps and dropped samples

  [[nodiscard]] double mean_delay_us() const {
    return scheduled == 0 ? 0.0
                          : 1e-3 * static_cast<double>(delay_ns) / static_cast<double>(scheduled);
  }
};

/// By the name of the stream; its thread is "abbe-" and this name.
using AcquisitionPhases = std::map<std::string, AcquisitionPhase>;

/// Fields of /proc/PID/task/TID/schedstat: time on a processor, time spent runnable but waiting for
/// one (both in ns), number of times scheduled [Linux, Documentation/scheduler/sched-stats.rst].
inline void read_scheduling(pid_t process, const std::string& thread, AcquisitionPhase& phase) {
  const pid_t id = test::thread_of(process, thread);
  if (id == 0) throw std::runtime_error("abbed has no thread " + thread);
  std::ifstream in{"/proc/" + std::to_string(process) + "/task/" + std::to_string(id) +
                   "/schedstat"};
  std::uint64_t on_processor_ns = 0, delay_ns = 0, scheduled = 0;
  if (!(in >> on_processor_ns >> delay_ns >> scheduled)) return;
  phase.delay_ns = delay_ns;
  phase.scheduled = scheduled;
}

/// Since the start of abbed. `status`: its reply to a status request; `process`: its id.
inline AcquisitionPhases acquisition_until_now(const nlohmann::json& status, pid_t process) {
  constexpr std::size_t kLongestName = 15;  // of a thread, in Linux
  AcquisitionPhases all;
  for (const auto& stream : status["streams"]) {
    const auto counts = stream.value("latency_counts", nlohmann::json::array());
    if (counts.empty()) continue;  // no device
    const auto name = stream["name"].get<std::string>();
    AcquisitionPhase& phase = all[name];
    for (const auto& bucket : counts)
      phase.receive[bucket[0].get<double>()] = bucket[1].get<std::uint64_t>();
    phase.lost = stream["gaps"].get<std::uint64_t>() + stream["dropped"].get<std::uint64_t>();
    read_scheduling(process, ("abbe-" + name).substr(0, kLongestName), phase);
  }

  return all;
}

inline AcquisitionPhases difference(AcquisitionPhases later, const AcquisitionPhases& earlier) {
  for (auto& [stream, phase] : later) {
    const auto before = earlier.find(stream);
    if (before == earlier.end()) continue;
    for (const auto& [bound_s, count] : before->second.receive) phase.receive[bound_s] -= count;
    phase.delay_ns -= before->second.delay_ns;
    phase.scheduled -= before->second.scheduled;
    phase.lost -= before->second.lost;
  }

  return later;
}

inline void add(AcquisitionPhase& sum, const AcquisitionPhase& more) {
  for (const auto& [bound_s, count] : more.receive) sum.receive[bound_s] += count;
  sum.delay_ns += more.delay_ns;
  sum.scheduled += more.scheduled;
  sum.lost += more.lost;
}

}  // namespace abbe::bench
