#include "event_loop.hpp"

#include <sys/prctl.h>

#include <algorithm>

namespace abbe::sim {
namespace {

constexpr std::chrono::nanoseconds kLongestWait = std::chrono::milliseconds{200};

volatile std::sig_atomic_t stop_requested = 0;
void request_stop(int) {
  stop_requested = 1;
}

}  // namespace

EventLoop::EventLoop(double speed) : clock_(speed) {
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // SIGINT and SIGTERM are unblocked only while waiting, so that none of them is lost between
  // stopped() and the wait.
  sigset_t blocked;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGINT);
  sigaddset(&blocked, SIGTERM);
  sigprocmask(SIG_BLOCK, &blocked, &mask_while_waiting_);
  // Timer slack of 1 ns. With the default of 50 us, a wait at 20 times real time could end 1 ms of
  // simulated time too late.
  prctl(PR_SET_TIMERSLACK, 1);
}

bool EventLoop::stopped() const {
  return stop_requested != 0;
}

void wait(std::vector<pollfd>& fds, const SimClock& clock, HostTime due,
          const sigset_t* blocked_signals) {
  std::chrono::nanoseconds wall = kLongestWait;
  if (due != HostTime::max()) {
    wall = std::clamp(clock.wall(due - clock.now()), std::chrono::nanoseconds{0}, kLongestWait);
  }
  const timespec timeout{wall.count() / 1'000'000'000, wall.count() % 1'000'000'000};
  ppoll(fds.data(), fds.size(), &timeout, blocked_signals);
}

}  // namespace abbe::sim
