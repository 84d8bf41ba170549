#pragma once
/// The turns of the hub in which the live run had the samples of one stream. A driver hands its
/// bytes over before what it makes of them, and the hub empties a device's samples before its
/// bytes: so it has bytes in the turn of their sample or earlier, and what a replay decodes from
/// them waits for that turn.

#include <chrono>
#include <deque>
#include <map>
#include <utility>
#include <vector>

#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

template <class Sample>
class LiveCycles {
 public:
  using HostTime = protocol::HostTime;

  /// The live run has a sample of the instant `time` in `turn`, which is still to come.
  void expect(HostTime time, HostTime turn) { turn_of_.emplace(time, turn); }

  /// Leaves in `decoded` what the live run had by the turn `now`. What it never had, because it was
  /// lost there or the settings were others, waits for nothing but those before it.
  void hold(HostTime now, std::vector<Sample>& decoded) {
    for (Sample& sample : decoded) {
      const HostTime turn = turn_of(sample.head.time, now);
      waiting_.push_back({turn, std::move(sample)});
    }
    decoded.clear();
    for (; !waiting_.empty() && waiting_.front().turn <= now; waiting_.pop_front())
      decoded.push_back(std::move(waiting_.front().sample));
    while (!turn_of_.empty() && now - turn_of_.begin()->first > kForgotten)
      turn_of_.erase(turn_of_.begin());
  }

 private:
  // Nothing reaches the hub so long after its instant but the backlog of a tracker, which may pass
  // at once.
  static constexpr auto kForgotten = std::chrono::minutes{1};
  struct Waiting {
    HostTime turn;
    Sample sample;
  };

  HostTime turn_of(HostTime time, HostTime now) {
    const auto live = turn_of_.lower_bound(time);  // of equal ones the first
    return live == turn_of_.end() || live->first != time ? now : turn_of_.extract(live).mapped();
  }

  std::multimap<HostTime, HostTime> turn_of_;  ///< by the instant of the sample
  std::deque<Waiting> waiting_;
};

}  // namespace abbe::daemon
