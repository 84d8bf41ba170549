#pragma once
/// Turns something steppable with real time: waits for its sockets or its next due time, then polls it, until
/// SIGINT or SIGTERM.

#include <poll.h>

#include <chrono>
#include <csignal>
#include <vector>

#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

class EventLoop {
 public:
  /// From here on SIGINT and SIGTERM only end the loop.
  explicit EventLoop(double speed);

  [[nodiscard]] const SimClock& clock() const { return clock_; }
  [[nodiscard]] bool stopped() const;
  /// Until a socket is ready, `due` is there, a signal comes, or 200 ms of the wall are over.
  void wait(std::vector<pollfd>& fds, HostTime due) const;

 private:
  SimClock clock_;
  sigset_t signals_while_waiting_{};
};

}  // namespace abbe::sim
