#include "abbe/sim/simulation.hpp"

#include <algorithm>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::sim {

Simulation::Simulation(TruthMachine truth, PathMotion path, const SimulationSetup& setup,
                       std::optional<ControlPort> control)
    : control_(std::move(control)),
      machine_(std::move(truth), std::move(path), control_ ? control_->motion() : nullptr),
      start_when_streaming_(setup.start_when_streaming),
      held_(setup.held),
      standstill_(setup.standstill),
      bus_apart_(setup.bus_apart) {
  for (const ScheduledFault& fault : setup.faults)
    (fault.target == FaultTarget::Encoder ? bus_faults_ : faults_).add(fault);
}

Result<std::unique_ptr<Simulation>> Simulation::open(const SimulationSetup& setup, HostTime now) {
  auto path = PathMotion::plan(setup.path);
  ABBE_TRY(path);
  std::optional<ControlPort> control;
  if (setup.control_port) {
    auto opened = ControlPort::open(*setup.control_port);
    ABBE_TRY(opened);
    control.emplace(std::move(*opened));
  }
  std::unique_ptr<Simulation> simulation(
      new Simulation(setup.truth, std::move(*path), setup, std::move(control)));

  ABBE_TRY(simulation->open_tracker(setup, now));
  if (setup.axis_lines) {
    ABBE_TRY(simulation->open_line_axes(*setup.axis_lines, now));
  }

  if (setup.bus) {
    auto nodes = setup.nodes;
    for (EncoderNodeOptions& node : nodes) node.configured = setup.sync_period.count() > 0;
    auto bus = EncoderBus::open(*setup.bus, nodes, simulation->machine_, now);
    ABBE_TRY(bus);
    simulation->bus_.emplace(std::move(*bus));
    if (setup.sync_period.count() > 0)
      simulation->bus_->produce_sync(setup.sync_period, now + setup.sync_period);
  }

  for (const ModbusServerOptions& options : setup.environment) {
    auto server = ModbusServer::open(options, now);
    ABBE_TRY(server);
    simulation->environment_.push_back(std::move(*server));
  }

  for (const CounterCardSetup& card : setup.counter_cards) {
    auto server = UsbipServer::open(card.port, wire(card, simulation->machine_));
    ABBE_TRY(server);
    simulation->counter_cards_.push_back(std::move(*server));
  }

  if (setup.measuring_machine) {
    auto server = IppDmeServer::open(setup.measuring_machine_port,
                                     std::make_unique<IppDmeDevice>(*setup.measuring_machine, now));
    ABBE_TRY(server);
    simulation->measuring_machine_.emplace(std::move(*server));
  }

  if (setup.surface) {
    const auto edges = edge_times_s(*setup.surface, simulation->machine_.path());
    simulation->edges_s_.assign(edges.begin(), edges.end());
  }

  simulation->edges_s_.insert(simulation->edges_s_.end(), setup.edges_s.begin(),
                              setup.edges_s.end());
  if (!setup.start_when_streaming && !setup.held && !setup.control_port)
    simulation->machine_.start(now + setup.standstill);

  return simulation;
}

Result<void> Simulation::open_tracker(const SimulationSetup& setup, HostTime now) {
  if (!setup.tracker) return {};
  if (!setup.tracker_lines) {
    auto tracker = TrackerServer::open(
        setup.tracker_port, std::make_unique<TrackerDevice>(*setup.tracker, machine_, now));
    ABBE_TRY(tracker);
    tracker_.emplace(std::move(*tracker));
    return {};
  }
  const LineTrackerOptions options{.model = setup.tracker->model,
                                   .delay = setup.tracker->delay,
                                   .separation = setup.tracker_lines->separation,
                                   .format = setup.tracker_lines->format};
  LineOutput output = setup.tracker_lines->output;
  output.port = setup.tracker_port;
  auto tracker =
      LineTrackerServer::open(output, std::make_unique<LineTracker>(options, machine_, now), now);
  ABBE_TRY(tracker);
  line_tracker_.emplace(std::move(*tracker));
  return {};
}

Result<void> Simulation::open_line_axes(const PrintedAxes& axes, HostTime now) {
  auto server = LineAxesServer::open(axes.output,
                                     std::make_unique<LineAxes>(axes.options, machine_, now), now);
  ABBE_TRY(server);
  line_axes_.emplace(std::move(*server));
  return {};
}

void Simulation::poll(HostTime now) {
  if (control_) control_->poll(now);
  if (tracker_) tracker_->poll(now);
  if (line_tracker_) line_tracker_->poll(now);
  if (line_axes_) line_axes_->poll(now);
  start_machine(now);
  touch(now);
  while (const auto* fault = faults_.take_due(machine_, now)) inject(*fault, now);
  if (!bus_apart_) poll_bus(now);
  for (ModbusServer& server : environment_) server.poll(now);
  for (UsbipServer& card : counter_cards_) card.poll(now);
  if (measuring_machine_) measuring_machine_->poll(now);
}

void Simulation::poll_bus(HostTime now) {
  if (!bus_) return;
  while (const auto* fault = bus_faults_.take_due(machine_, now)) bus_->inject(fault->fault, now);
  bus_->poll(now);
}

HostTime Simulation::next_bus_due() const {
  return bus_ ? std::min(bus_->next_due(), bus_faults_.next_due(machine_)) : HostTime::max();
}

void Simulation::start_machine(HostTime now) {
  if (machine_.started()) return;
  if (control_) {
    if (const auto first = control_->motion()->first()) machine_.start(*first);
    return;
  }
  if (!start_when_streaming_ || held_) return;
  if (tracker_ || line_tracker_) {
    const auto streaming =
        tracker_ ? tracker_->device().first_stream() : line_tracker_->device().first_stream();
    if (streaming) machine_.start(*streaming + standstill_);
  } else if (!counter_cards_.empty() && counter_cards_.front().card().scanning()) {
    machine_.start(now + standstill_);
  }
}

void Simulation::release(HostTime now) {
  held_ = false;
  machine_.start(now + standstill_);
}

/// Passes the probe edges of the next second to the card, which must know an edge before it makes
/// the scan that shows the edge.
void Simulation::touch(HostTime now) {
  constexpr auto kAhead = std::chrono::seconds{1};
  if (!machine_.started() || counter_cards_.empty()) return;
  for (; !edges_s_.empty(); edges_s_.pop_front()) {
    const HostTime at = *machine_.started() + seconds_to_ns(edges_s_.front());
    if (at > now + kAhead) return;
    counter_cards_.front().card().add_probe_edge(at);
  }
}

void Simulation::inject(const ScheduledFault& next, HostTime now) {
  if (next.target == FaultTarget::Tracker && tracker_) {
    tracker_->device().inject(next.fault, now);
    tracker_->poll(now);
  }
  if (next.target == FaultTarget::Tracker && line_tracker_) {
    line_tracker_->device().inject(next.fault, now);
    line_tracker_->poll(now);
  }
  if (next.target == FaultTarget::AxisLines && line_axes_) {
    line_axes_->device().inject(next.fault, now);
    line_axes_->poll(now);
  }
  if (next.target == FaultTarget::MeasuringMachine && measuring_machine_)
    measuring_machine_->device().inject(next.fault, now);
  if (next.target == FaultTarget::Environment) inject_environment(next.fault, now);
  if (next.target != FaultTarget::CounterCard) return;
  for (UsbipServer& card : counter_cards_) card.inject(next.fault, now);
}

void Simulation::inject_environment(const Fault& fault, HostTime now) {
  for (std::size_t i = 0; i < environment_.size(); ++i) {
    if (fault.node == 0 || fault.node == i + 1) environment_[i].inject(fault, now);
  }
}

HostTime Simulation::next_due() const {
  HostTime due = faults_.next_due(machine_);
  if (tracker_) due = std::min(due, tracker_->next_due());
  if (line_tracker_) due = std::min(due, line_tracker_->next_due());
  if (line_axes_) due = std::min(due, line_axes_->next_due());
  if (!bus_apart_) due = std::min(due, next_bus_due());
  for (const ModbusServer& server : environment_) due = std::min(due, server.next_due());
  for (const UsbipServer& card : counter_cards_) due = std::min(due, card.next_due());
  if (measuring_machine_) due = std::min(due, measuring_machine_->next_due());
  return due;
}

void Simulation::add_poll_fds(std::vector<pollfd>& fds) const {
  if (control_) fds.push_back({control_->fd(), POLLIN, 0});
  if (tracker_) tracker_->add_poll_fds(fds);
  if (line_tracker_) line_tracker_->add_poll_fds(fds);
  if (line_axes_) line_axes_->add_poll_fds(fds);
  if (bus_ && !bus_apart_) fds.push_back({bus_->fd(), POLLIN, 0});
  for (const ModbusServer& server : environment_) server.add_poll_fds(fds);
  for (const UsbipServer& card : counter_cards_) card.add_poll_fds(fds);
  if (measuring_machine_) measuring_machine_->add_poll_fds(fds);
}

}  // namespace abbe::sim
