/// abbe-sim run: the simulation in real time on real sockets, until SIGINT or SIGTERM.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "abbe/sim/simulation.hpp"
#include "abbe/sim/truth_table.hpp"
#include "bus_thread.hpp"
#include "commands.hpp"
#include "event_loop.hpp"
#include "files.hpp"
#include "ports_file.hpp"
#include "setup_file.hpp"

namespace abbe::sim {
namespace {

struct RunOptions {
  SetupChoices choices;
  std::string ports_file;
  std::string truth_out;
};

/// Prints the progress of the machine on stderr; a progress bar only on a terminal.
class ProgressDisplay {
 public:
  explicit ProgressDisplay(double speed) : speed_(speed) {}

  void update(Simulation& simulation, HostTime now) {
    const bool client = simulation.tracker() && simulation.tracker()->client_fd() >= 0;
    if (client != client_)
      fmt::print(stderr, "{}tracker: client {}\n", bar_end(),
                 client ? "connected" : "disconnected");
    client_ = client;
    const VirtualMachine& machine = simulation.machine();

    if (machine.follows_a_control()) return follow(*simulation.control(), now);
    if (machine.started() && !announced_start_) {
      announced_start_ = true;
      fmt::print(stderr, "{}machine: {} legs, {:.0f} s ({:.0f} s of wall-clock time)\n", bar_end(),
                 machine.path().legs(), machine.path().duration_s(),
                 machine.path().duration_s() / speed_);
    }

    if (machine.finished() && now >= *machine.finished() && !announced_end_) {
      announced_end_ = true;
      fmt::print(stderr, "{}machine: path driven, stopped at its end\n", bar_end());
    }

    if (announced_start_ && !announced_end_) draw(machine, now);
  }

 private:
  /// Reports the first position, and lost records at most once in 5 s.
  void follow(const ControlPort& control, HostTime now) {
    constexpr std::chrono::seconds kBetweenReports{5};
    const FollowedMotion::Counts counts = control.motion()->counts();
    if (counts.not_homed > 0 && !announced_not_homed_ && counts.received == 0)
      fmt::print(stderr, "control: its axes are not homed; the machine stands\n");
    announced_not_homed_ = counts.not_homed > 0;
    if (counts.received > 0 && !announced_start_)
      fmt::print(stderr, "control: the machine follows its positions\n");
    announced_start_ = counts.received > 0;
    const std::uint64_t faults = counts.lost + counts.restarts + control.not_records();
    if (faults == reported_faults_ || now - reported_at_ < kBetweenReports) return;
    reported_faults_ = faults;
    reported_at_ = now;
    fmt::print(stderr,
               "control: {} records lost of {}, {} restarts, {} datagrams that are no record\n",
               counts.lost, counts.received + counts.lost, counts.restarts, control.not_records());
  }

  void draw(const VirtualMachine& machine, HostTime now) {
    const double share =
        std::clamp(ns_to_seconds(now - *machine.started()) / machine.path().duration_s(), 0.0, 1.0);
    const int percent = static_cast<int>(100.0 * share);
    if (!terminal_ || percent == drawn_) return;
    drawn_ = percent;
    fmt::print(stderr, "\rmachine: {:3d} % [{:<40}]", percent,
               std::string(static_cast<std::size_t>(percent) * 40 / 100, '#'));
  }
  const char* bar_end() {
    const bool open = drawn_ >= 0;
    drawn_ = -1;
    return open ? "\n" : "";
  }

  double speed_;
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  bool client_ = false;
  bool announced_not_homed_ = false;
  std::uint64_t reported_faults_ = 0;
  HostTime reported_at_{};
  bool announced_start_ = false;
  bool announced_end_ = false;
  int drawn_ = -1;
};

int run(const RunOptions& options) {
  auto setup = load_setup(options.choices);
  if (!setup) return report(setup.error());
  setup->simulation.bus_apart = true;

  if (!options.truth_out.empty()) {
    const auto written = write_file(options.truth_out, format_truth_csv(setup->simulation.truth));
    if (!written) return report(written.error());
  }

  const EventLoop loop(setup->speed);
  auto simulation = Simulation::open(setup->simulation, loop.clock().now());
  if (!simulation) return report(simulation.error());
  const Ports ports = ports_of(**simulation, setup->simulation.bus->interface);
  if (const auto announced = announce_ports(ports, options.ports_file); !announced)
    return report(announced.error());
  BusThread encoders(**simulation, loop.clock());
  ProgressDisplay progress(setup->speed);

  while (!loop.stopped()) {
    std::vector<pollfd> fds;
    (*simulation)->add_poll_fds(fds);
    loop.wait(fds, (*simulation)->next_due());
    const HostTime now = loop.clock().now();
    (*simulation)->poll(now);
    encoders.check();
    progress.update(**simulation, now);
  }

  return kDone;
}

}  // namespace

Subcommand add_run(CLI::App& app) {
  auto options = std::make_shared<RunOptions>();  // lives as long as the command line's callbacks
  SetupChoices& choices = options->choices;
  CLI::App* sub = app.add_subcommand(
      "run", "machine, tracker, encoders and counter card on 127.0.0.1 until SIGINT or SIGTERM");
  add_machine_options(*sub, choices);
  sub->add_option("--path", choices.path_file, "CSV x_mm,y_mm,z_mm[,feed_mm_per_min]")
      ->type_name("FILE");
  sub->add_option("--feed-mm-per-min", choices.feed_mm_per_min, "default 2500")
      ->check(CLI::PositiveNumber);
  sub->add_option("--dwell-s", choices.dwell_s,
                  "standstill at every vertex (default 0.05; standstill mode needs 0.3)")
      ->check(CLI::NonNegativeNumber);
  sub->add_option("--speed", choices.speed,
                  "simulated seconds per second; the daemon must be given the same")
      ->check(CLI::Range(1e-3, 1e4));
  sub->add_option("--tracker-port", choices.tracker_port, "TCP; 0 = any free one");
  sub->add_option("--can-port", choices.can_port, "UDP; 0 = any free one");
  sub->add_option("--can-peer-port", choices.can_peer_port,
                  "UDP port of the daemon; 0 = the sender of the latest datagram");
  sub->add_option("--can-interface", choices.can_interface,
                  "SocketCAN interface instead of UDP: vcan0");
  sub->add_option("--usbip-port", choices.usbip_port, "TCP, of the counter card; 0 = any free one");
  sub->add_option("--ports-file", options->ports_file,
                  "written when all ports listen: lines tracker_port=N, can_port=N, usbip_port=N")
      ->type_name("FILE");
  sub->add_option("--truth-out", options->truth_out, "write the errors of this machine as CSV")
      ->type_name("FILE");
  CLI::Option* streaming = sub->add_flag(
      "--start-when-streaming", choices.start_when_streaming,
      "move after the standstill, which begins with the tracker's first point (default)");
  sub->add_flag("--start-at-once", choices.start_at_once,
                "move after the standstill, without waiting for the tracker")
      ->excludes(streaming);

  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim
