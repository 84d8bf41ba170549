#pragma once
/// The hub cycles in which the live run received the samples of one stream. A driver passes on raw
/// bytes before the sample decoded from them, and the hub drains samples before bytes. The recorded
/// bytes can therefore be in an earlier cycle than their sample. For this reason, the replay holds
/// back a sample that it decoded from the bytes until the cycle in which the live run received it.

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

  /// Announces a live sample before the replay reaches it. `time`: the instant of the sample;
  /// `turn`: the time of the cycle in which the live run received it.
  void expect(HostTime time, HostTime turn) { turn_of_.emplace(time, turn); }

  /// Leaves in `decoded` the samples that the live run had received by the cycle `now`, and holds
  /// back the others. A sample that the live run never received (lost, or other settings) is held
  /// back only as long as samples decoded before it.
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
  // Announced samples that are older than this are removed, because their bytes were lost. Only
  // samples that a stalled tracker sends late reach the hub later than this, and these need not be
  // held back.
  static constexpr auto kForgotten = std::chrono::minutes{1};
  struct Waiting {
    HostTime turn;
    Sample sample;
  };

  HostTime turn_of(HostTime time, HostTime now) {
    const auto live = turn_of_.lower_bound(time);  // for equal instants, the first one
    return live == turn_of_.end() || live->first != time ? now : turn_of_.extract(live).mapped();
  }

  std::multimap<HostTime, HostTime> turn_of_;  ///< times of cycles, by the instant of the sample
  std::deque<Waiting> waiting_;
};

}  // namespace abbe::daemon
