#pragma once
/// Turns something steppable with real time: waits for its sockets or its next due time, then polls
/// it, until SIGINT or SIGTERM.

#include <poll.h>

#include <chrono>
#include <csignal>
#include <vector>

#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

/// Until a socket is ready, `due` is there, 200 ms of the wall are over, or a signal comes that is
/// not held back. `held_back`: those, while waiting; null: those of this thread.
void wait(std::vector<pollfd>& fds, const SimClock& clock, HostTime due,
          const sigset_t* held_back = nullptr);

class EventLoop {
 public:
  /// From here on SIGINT and SIGTERM only end the loop.
  explicit EventLoop(double speed);

  [[nodiscard]] const SimClock& clock() const { return clock_; }
  [[nodiscard]] bool stopped() const;
  /// Also until SIGINT or SIGTERM comes.
  void wait(std::vector<pollfd>& fds, HostTime due) const {
    sim::wait(fds, clock_, due, &held_back_while_waiting_);
  }

 private:
  SimClock clock_;
  sigset_t held_back_while_waiting_{};
};

}  // namespace abbe::sim
