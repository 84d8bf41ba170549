#include "bus_thread.hpp"

#include <sys/eventfd.h>

#include <cerrno>
#include <chrono>
#include <system_error>

#include "event_loop.hpp"

namespace abbe::sim {
namespace {

void poll_until_stopped(Simulation& simulation, const SimClock& clock, int stop_fd) {
  std::vector<pollfd> fds{{simulation.bus()->fd(), POLLIN, 0}, {stop_fd, POLLIN, 0}};
  while ((fds[1].revents & POLLIN) == 0) {
    wait(fds, clock, simulation.next_bus_due());
    simulation.poll_bus(clock.now());
  }
}

Socket make_event() {
  Socket event(::eventfd(0, EFD_CLOEXEC));
  if (!event) throw std::system_error(errno, std::generic_category(), "eventfd");
  return event;
}

}  // namespace

BusThread::BusThread(Simulation& simulation, SimClock clock)
    : stop_(make_event()),
      polling_(std::async(std::launch::async, [&simulation, clock, fd = stop_.get()] {
        poll_until_stopped(simulation, clock, fd);
      })) {}

BusThread::~BusThread() {
  ::eventfd_write(stop_.get(), 1);
  if (polling_.valid()) polling_.wait();
}

void BusThread::check() {
  if (polling_.wait_for(std::chrono::seconds{0}) == std::future_status::ready) polling_.get();
}

}  // namespace abbe::sim
