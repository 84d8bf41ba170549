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
  // Let through only while waiting, so that none falls between the question and the wait.
  sigset_t held;
  sigemptyset(&held);
  sigaddset(&held, SIGINT);
  sigaddset(&held, SIGTERM);
  sigprocmask(SIG_BLOCK, &held, &held_back_while_waiting_);
  prctl(PR_SET_TIMERSLACK, 1);  // ns; at 20 times real time the usual 50 us would be a millisecond
}

bool EventLoop::stopped() const {
  return stop_requested != 0;
}

void wait(std::vector<pollfd>& fds, const SimClock& clock, HostTime due,
          const sigset_t* held_back) {
  std::chrono::nanoseconds wall = kLongestWait;
  if (due != HostTime::max()) {
    wall = std::clamp(clock.wall(due - clock.now()), std::chrono::nanoseconds{0}, kLongestWait);
  }
  const timespec timeout{wall.count() / 1'000'000'000, wall.count() % 1'000'000'000};
  ppoll(fds.data(), fds.size(), &timeout, held_back);
}

}  // namespace abbe::sim
