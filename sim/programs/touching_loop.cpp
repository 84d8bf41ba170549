#include "touching_loop.hpp"

#include <fmt/format.h>

#include <csignal>
#include <vector>

#include "commands.hpp"
#include "event_loop.hpp"
#include "ports_file.hpp"

namespace abbe::sim {
namespace {

volatile std::sig_atomic_t start_requested = 0;

void start_on_sigusr1() {
  struct sigaction action {};
  action.sa_handler = [](int) { start_requested = 1; };
  sigaction(SIGUSR1, &action, nullptr);
}

/// Prints when the motion begins and when it ends; `printed`: number of lines so far.
void print_progress(const Simulation& simulation, HostTime now, double speed, int& printed) {
  const VirtualMachine& machine = simulation.machine();
  if (machine.started() && printed == 0) {
    printed = 1;
    fmt::print(stderr, "machine: touching, {:.0f} s ({:.0f} s of wall-clock time)\n",
               machine.path().duration_s(), machine.path().duration_s() / speed);
  }
  if (machine.finished() && now >= *machine.finished() && printed == 1) {
    printed = 2;
    fmt::print(stderr, "machine: all touches made, stopped\n");
  }
}

}  // namespace

int run_touching(const SimulationSetup& setup, const TouchingLoop& options,
                 const std::string& what) {
  start_on_sigusr1();
  const EventLoop loop(options.speed);
  auto simulation = Simulation::open(setup, loop.clock().now());
  if (!simulation) return report(simulation.error());
  if (const auto announced = announce_ports(ports_of(**simulation), options.ports_file); !announced)
    return report(announced.error());
  fmt::print(stderr, "{}{}\n", what,
             options.start_on_signal ? ", start on SIGUSR1" : ", start when the card is scanning");
  int printed = 0;

  while (!loop.stopped()) {
    std::vector<pollfd> fds;
    (*simulation)->add_poll_fds(fds);
    loop.wait(fds, (*simulation)->next_due());
    const HostTime now = loop.clock().now();
    if (start_requested != 0 && !(*simulation)->machine().started()) (*simulation)->release(now);
    (*simulation)->poll(now);
    print_progress(**simulation, now, options.speed, printed);
  }

  return kDone;
}

}  // namespace abbe::sim
