#pragma once
/// The complete simulation: machine, the control that it follows, tracker, encoder bus, counter
/// cards, measuring machine and scheduled faults, stepped together. poll(now) does what is due,
/// never blocks and reads no clock; a program passes real time, a test any time. Not thread-safe.
/// Exception: if `bus_apart` is set, another thread may poll the encoder bus.

#include <poll.h>

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "abbe/sim/control_port.hpp"
#include "abbe/sim/counter_card_setup.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "abbe/sim/fault_timetable.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "abbe/sim/line_tracker_server.hpp"
#include "abbe/sim/modbus_server.hpp"
#include "abbe/sim/touched_surface.hpp"
#include "abbe/sim/tracker_server.hpp"
#include "abbe/sim/usbip_server.hpp"

namespace abbe::sim {

struct PrintedLines {
  lines::LineFormat format;
  /// interval between two points
  std::chrono::nanoseconds separation = std::chrono::milliseconds{2};
  LineOutput output;
};

struct PrintedAxes {
  LineAxesOptions options;
  LineOutput output;
};

struct SimulationSetup {
  TruthMachine truth;
  PathPlan path;
  /// true: the motion starts when the tracker streams (without a tracker: when the first counter
  /// card scans). false: the motion starts by itself.
  bool start_when_streaming = true;
  bool held = false;  ///< the motion starts only after release()
  /// Time at standstill before the motion. It begins with the first point or scan or, if the motion
  /// starts by itself, with the simulation.
  std::chrono::nanoseconds standstill = std::chrono::seconds{2};
  std::optional<TrackerOptions> tracker;
  std::uint16_t tracker_port = 0;
  /// The tracker prints lines instead of emScon. Model and delay are those of `tracker`, the port
  /// is `tracker_port`.
  std::optional<PrintedLines> tracker_lines;
  /// The control prints the positions of the axes as lines.
  std::optional<PrintedAxes> axis_lines;
  /// UDP port of the position records of a control, which the machine then follows instead of
  /// `path`; 0: the kernel chooses it. nullopt: no control.
  std::optional<std::uint16_t> control_port;
  std::optional<EncoderBusOptions> bus;
  std::vector<EncoderNodeOptions> nodes;
  /// Period of the SYNC that the machine's control sends to nodes configured by it; 0: the control
  /// neither sends a SYNC nor configures the nodes.
  std::chrono::nanoseconds sync_period{};
  /// Only poll_bus() polls the bus, so that a second thread can do it. A SYNC at the moment at
  /// which the other thread starts the machine may still be answered with the position before the
  /// start. With a standstill both positions are equal.
  bool bus_apart = false;
  std::vector<ModbusServerOptions> environment;
  std::vector<CounterCardSetup> counter_cards;
  std::optional<IppDmeOptions> measuring_machine;
  std::uint16_t measuring_machine_port = 0;
  std::optional<TouchedSurface> surface;  ///< touched by the probe on the first counter card
  /// further edges of the probe on the first counter card, s from the start of the motion,
  /// ascending
  std::vector<double> edges_s;
  std::vector<ScheduledFault> faults;
};

class Simulation {
 public:
  /// Opens the sockets. Error BadInput for an impossible path, Io if a port is in use.
  [[nodiscard]] static Result<std::unique_ptr<Simulation>> open(const SimulationSetup& setup,
                                                                HostTime now);

  void poll(HostTime now);
  /// Polls the encoders and their faults, with `bus_apart`. May run on a separate thread; only
  /// this thread may then use bus().
  void poll_bus(HostTime now);
  [[nodiscard]] HostTime next_bus_due() const;
  /// Ends `held`: the motion starts after the standstill.
  void release(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// Adds to `fds` the sockets that the caller must wait for, until next_due() at the latest.
  void add_poll_fds(std::vector<pollfd>& fds) const;

  [[nodiscard]] VirtualMachine& machine() { return machine_; }
  [[nodiscard]] const VirtualMachine& machine() const { return machine_; }
  [[nodiscard]] const std::optional<ControlPort>& control() const { return control_; }
  [[nodiscard]] std::optional<TrackerServer>& tracker() { return tracker_; }
  [[nodiscard]] std::optional<LineTrackerServer>& line_tracker() { return line_tracker_; }
  [[nodiscard]] std::optional<LineAxesServer>& line_axes() { return line_axes_; }
  [[nodiscard]] std::optional<EncoderBus>& bus() { return bus_; }
  [[nodiscard]] const std::vector<ModbusServer>& environment() const { return environment_; }
  [[nodiscard]] std::deque<UsbipServer>& counter_cards() { return counter_cards_; }
  [[nodiscard]] std::optional<IppDmeServer>& measuring_machine() { return measuring_machine_; }
  [[nodiscard]] const std::optional<IppDmeServer>& measuring_machine() const {
    return measuring_machine_;
  }

 private:
  Simulation(TruthMachine truth, PathMotion path, const SimulationSetup& setup,
             std::optional<ControlPort> control);
  [[nodiscard]] Result<void> open_tracker(const SimulationSetup& setup, HostTime now);
  [[nodiscard]] Result<void> open_line_axes(const PrintedAxes& axes, HostTime now);
  void start_machine(HostTime now);
  void touch(HostTime now);
  void inject_environment(const Fault& fault, HostTime now);
  void inject(const ScheduledFault& next, HostTime now);

  std::optional<ControlPort> control_;
  VirtualMachine machine_;
  bool start_when_streaming_;
  bool held_;
  std::chrono::nanoseconds standstill_;
  std::optional<TrackerServer> tracker_;
  std::optional<LineTrackerServer> line_tracker_;
  std::optional<LineAxesServer> line_axes_;
  std::optional<EncoderBus> bus_;
  bool bus_apart_;
  FaultTimetable bus_faults_;
  std::vector<ModbusServer> environment_;
  std::deque<UsbipServer> counter_cards_;
  std::optional<IppDmeServer> measuring_machine_;
  std::deque<double> edges_s_;  ///< probe edges not yet passed to the card
  FaultTimetable faults_;       ///< faults of all devices except the bus
};

}  // namespace abbe::sim
