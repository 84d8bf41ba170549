#pragma once
/// The whole stage: machine, tracker, encoder bus, counter cards, a measuring machine and the
/// timetable of faults, stepped together. poll(now) does what is due, never blocks and reads no
/// clock; a program turns it with real time, a test with whatever it likes. Not thread-safe, but
/// for the bus with `bus_apart`.

#include <poll.h>

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "abbe/sim/counter_card_setup.hpp"
#include "abbe/sim/encoder_bus.hpp"
#include "abbe/sim/fault_timetable.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "abbe/sim/modbus_server.hpp"
#include "abbe/sim/touched_surface.hpp"
#include "abbe/sim/tracker_server.hpp"
#include "abbe/sim/usbip_server.hpp"

namespace abbe::sim {

struct SimulationSetup {
  TruthMachine truth;
  PathPlan path;
  bool start_when_streaming =
      true;           ///< tracker, or without one the first counter card; else by itself
  bool held = false;  ///< not before let_go()
  /// before the motion, from the first point or from the start
  std::chrono::nanoseconds standstill = std::chrono::seconds{2};
  std::optional<TrackerOptions> tracker;
  std::uint16_t tracker_port = 0;
  std::optional<EncoderBusOptions> bus;
  std::vector<EncoderNodeOptions> nodes;
  /// The machine's own control sends the SYNC and has configured the nodes; 0: neither.
  std::chrono::nanoseconds sync_period{};
  /// The bus is turned by poll_bus() alone. A SYNC is then answered as the machine stands, not as
  /// it would after a start that the other thread is about to make: with a standstill nobody can
  /// tell.
  bool bus_apart = false;
  std::vector<ModbusServerOptions> environment;
  std::vector<CounterCardSetup> counter_cards;
  std::optional<IppDmeOptions> measuring_machine;
  std::uint16_t measuring_machine_port = 0;
  std::optional<TouchedSurface> surface;  ///< touched by the probe on the first card
  std::vector<double>
      edges_s;  ///< further edges of that probe, s from the start of the motion, ascending
  std::vector<ScheduledFault> faults;
};

class Simulation {
 public:
  /// Opens the sockets. BadInput for an impossible path, Io for a port that is taken.
  [[nodiscard]] static Result<std::unique_ptr<Simulation>> open(const SimulationSetup& setup,
                                                                HostTime now);

  void poll(HostTime now);
  /// The encoders and their faults, with `bus_apart`. May run on a thread of its own, which then is
  /// the only one to use bus().
  void poll_bus(HostTime now);
  [[nodiscard]] HostTime next_bus_due() const;
  /// Whoever held the machine waits no longer.
  void let_go(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// What to wait for besides the time.
  void add_poll_fds(std::vector<pollfd>& fds) const;

  [[nodiscard]] VirtualMachine& machine() { return machine_; }
  [[nodiscard]] const VirtualMachine& machine() const { return machine_; }
  [[nodiscard]] std::optional<TrackerServer>& tracker() { return tracker_; }
  [[nodiscard]] std::optional<EncoderBus>& bus() { return bus_; }
  [[nodiscard]] const std::vector<ModbusServer>& environment() const { return environment_; }
  [[nodiscard]] std::deque<UsbipServer>& counter_cards() { return counter_cards_; }
  [[nodiscard]] const std::optional<IppDmeServer>& measuring_machine() const {
    return measuring_machine_;
  }

 private:
  Simulation(TruthMachine truth, PathMotion path, const SimulationSetup& setup);
  void start_machine(HostTime now);
  void touch(HostTime now);
  void inject_environment(const Fault& fault, HostTime now);
  void inject(const ScheduledFault& next, HostTime now);

  VirtualMachine machine_;
  bool start_when_streaming_;
  bool held_;
  std::chrono::nanoseconds standstill_;
  std::optional<TrackerServer> tracker_;
  std::optional<EncoderBus> bus_;
  bool bus_apart_;
  FaultTimetable bus_faults_;
  std::vector<ModbusServer> environment_;
  std::deque<UsbipServer> counter_cards_;
  std::optional<IppDmeServer> measuring_machine_;
  std::deque<double> edges_s_;  ///< that the probe's card does not know of yet
  FaultTimetable faults_;       ///< of all but the bus
};

}  // namespace abbe::sim
