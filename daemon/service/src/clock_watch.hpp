#pragma once
/// Reports and records each change of the wall clock once. This is necessary because the dates in
/// the recording are computed with the clock at the start. One thread, not the hub's.

#include <utility>

#include "abbe/base/wall_clock.hpp"
#include "abbe/service/hub.hpp"

namespace abbe::daemon {

class ClockWatch {
 public:
  explicit ClockWatch(WallClock clock) : clock_(std::move(clock)) {}

  /// Compares the clocks with those at the start. Waits for the hub only if they changed. The hub
  /// must have a recorder.
  void cycle(Hub& hub);

 private:
  WallClock clock_;
  ClockChange reported_{};
};

}  // namespace abbe::daemon
