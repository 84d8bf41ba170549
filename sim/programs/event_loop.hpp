#pragma once
/// Runs steppable devices in real time until SIGINT or SIGTERM: waits for their sockets or for the
/// time at which the next action is due.

#include <poll.h>

#include <chrono>
#include <csignal>
#include <vector>

#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

/// Waits until a socket is ready, the time `due` is reached, 200 ms of wall-clock time have passed
/// or a signal arrives that is not in `blocked_signals`; null: the signal mask of the thread.
void wait(std::vector<pollfd>& fds, const SimClock& clock, HostTime due,
          const sigset_t* blocked_signals = nullptr);

class EventLoop {
 public:
  /// From now on SIGINT and SIGTERM set stopped() instead of ending the process.
  explicit EventLoop(double speed);

  [[nodiscard]] const SimClock& clock() const { return clock_; }
  [[nodiscard]] bool stopped() const;
  /// Same as sim::wait(), but SIGINT and SIGTERM also end the wait.
  void wait(std::vector<pollfd>& fds, HostTime due) const {
    sim::wait(fds, clock_, due, &mask_while_waiting_);
  }

 private:
  SimClock clock_;
  sigset_t mask_while_waiting_{};
};

}  // namespace abbe::sim
