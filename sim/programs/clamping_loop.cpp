#include "clamping_loop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>

#include "commands.hpp"
#include "event_loop.hpp"
#include "ports_file.hpp"

namespace abbe::sim {
namespace {

volatile std::sig_atomic_t clampings_requested = 0;

void count_sigusr1() {
  struct sigaction action {};
  action.sa_handler = [](int) { clampings_requested = clampings_requested + 1; };
  sigaction(SIGUSR1, &action, nullptr);
}

}  // namespace

int run_clamping(SimulationSetup setup, const std::vector<OnTable>& things,
                 const ClampingLoop& options) {
  count_sigusr1();
  setup.measuring_machine->machine = things.front().machine;
  const EventLoop loop(options.speed);
  auto simulation = Simulation::open(setup, loop.clock().now());
  if (!simulation) return report(simulation.error());
  if (const auto announced = announce_ports(ports_of(**simulation), options.ports_file); !announced)
    return report(announced.error());
  std::size_t clamped = 0;
  fmt::print(stderr, "on the table: {}; SIGUSR1: the next\n", things.front().name);

  while (!loop.stopped()) {
    std::vector<pollfd> fds;
    (*simulation)->add_poll_fds(fds);
    loop.wait(fds, (*simulation)->next_due());
    const auto asked = std::min(static_cast<std::size_t>(clampings_requested), things.size() - 1);
    if (clamped < asked) {
      clamped = asked;
      (*simulation)->measuring_machine()->device().put_on_table(things[clamped].machine);
      fmt::print(stderr, "on the table: {}\n", things[clamped].name);
    }
    (*simulation)->poll(loop.clock().now());
  }

  return kDone;
}

}  // namespace abbe::sim
