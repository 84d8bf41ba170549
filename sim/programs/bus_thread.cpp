#include "bus_thread.hpp"

#include <sys/eventfd.h>

#include <chrono>

#include "event_loop.hpp"

namespace abbe::sim {
namespace {

void turn(Simulation& simulation, const SimClock& clock, int stop_fd) {
  std::vector<pollfd> fds{{simulation.bus()->fd(), POLLIN, 0}, {stop_fd, POLLIN, 0}};
  while ((fds[1].revents & POLLIN) == 0) {
    wait(fds, clock, simulation.next_bus_due());
    simulation.poll_bus(clock.now());
  }
}

}  // namespace

BusThread::BusThread(Simulation& simulation, SimClock clock)
    : stop_(::eventfd(0, EFD_CLOEXEC)),
      turning_(std::async(std::launch::async,
                          [&simulation, clock, fd = stop_.get()] { turn(simulation, clock, fd); })) {}

BusThread::~BusThread() {
  ::eventfd_write(stop_.get(), 1);
  if (turning_.valid()) turning_.wait();
}

void BusThread::check() {
  if (turning_.wait_for(std::chrono::seconds{0}) == std::future_status::ready) turning_.get();
}

}  // namespace abbe::sim
