#pragma once
/// Each driver with its simulated device. The user runs the device in a thread (ServedDevices) and
/// calls the driver's cycles.

#include <fmt/format.h>
#include <unistd.h>

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/known_maps.hpp"
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/drivers/tracker/device.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"
#include "served_devices.hpp"

namespace abbe::tests {

using std::chrono::nanoseconds;
using namespace std::chrono_literals;
using Faults = std::vector<sim::ScheduledFault>;
using Heads = std::vector<protocol::SampleHead>;

inline const drivers::MonotonicTime& monotonic() {
  static const drivers::MonotonicTime time;
  return time;
}

/// How many; their heads go behind `heads`.
template <class Sample, class Ring>
std::size_t pop_all(Ring& ring, Heads* heads) {
  std::array<Sample, 256> some;  // NOLINT: filled by pop
  std::size_t all = 0;
  for (std::size_t n = some.size(); n == some.size(); all += n) {
    n = ring.pop(some);
    for (std::size_t i = 0; heads != nullptr && i < n; ++i) heads->push_back(some[i].head);
  }
  return all;
}

inline std::unique_ptr<sim::Simulation> open_simulation(sim::SimulationSetup setup,
                                                        const Faults& faults) {
  setup.path.vertices = {{{0, 0, 0}}, {{0.2, 0.1, 0}}, {{0, 0, 0}}};
  setup.start_when_streaming = false;
  setup.standstill = {};
  setup.faults = faults;
  return sim::Simulation::open(setup, monotonic().now()).value();
}

/// A driver's device, and the simulator that serves it.
template <class Device>
struct Simulated {
  [[nodiscard]] ServedDevices::Peer peer() const { return peer_of(*simulation); }

  std::unique_ptr<sim::Simulation> simulation;
  std::unique_ptr<Device> device;
};

struct Encoders : Simulated<drivers::EncoderDevice> {
  static constexpr const char* kName = "encoders, CAN over UDP, SYNC each 1 ms";

  explicit Encoders(const Faults& faults = {}) {
    sim::SimulationSetup setup;
    setup.bus.emplace();
    drivers::EncoderDeviceOptions options;

    for (std::uint8_t i = 0; i < 5; ++i) {
      const auto node = static_cast<protocol::can::NodeId>(i + 1);
      setup.nodes.push_back(
          {.node = node, .axis = sim::kAxes[i % sim::kAxes.size()], .boot_time = 20ms});
      options.receiver.axes.push_back({.name = std::string(1, "XYZAC"[i]), .node = node});
    }

    simulation = open_simulation(setup, faults);
    device = drivers::EncoderDevice::create(
                 options,
                 std::make_unique<drivers::UdpCanBus>(
                     drivers::UdpCanOptions{.peer_port = simulation->bus()->port()}, monotonic()),
                 monotonic())
                 .value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::AxisSample>(device->samples(), heads);
  }
};

struct Tracker : Simulated<drivers::TrackerDevice> {
  static constexpr const char* kName = "tracker, 500 points/s";
  static constexpr nanoseconds kPeriod = 2ms;
  static constexpr std::size_t kFirst = 200;

  explicit Tracker(const Faults& faults = {}) {
    sim::SimulationSetup setup;
    setup.tracker.emplace();
    setup.tracker->initialize_time = 100ms;
    simulation = open_simulation(setup, faults);
    drivers::TrackerDeviceOptions options;
    options.host = "127.0.0.1";
    options.port = simulation->tracker()->port();
    device = drivers::TrackerDevice::create(options, monotonic()).value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::TrackerPoint>(device->points(), heads);
  }
};

struct CounterCard : Simulated<drivers::CounterCardDevice> {
  static constexpr const char* kName =
      "counter card, USB/IP in the process, a transfer each 1.5 ms";
  static constexpr nanoseconds kPeriod = 1500us;
  static constexpr std::size_t kFirst = 2000;

  explicit CounterCard(const Faults& faults = {}) {
    sim::SimulationSetup setup;
    auto& card = setup.counter_cards.emplace_back();
    drivers::CounterCardOptions options;
    auto& wiring = options.receiver.wiring;

    for (std::uint8_t i = 0; i < 5; ++i) {
      const std::string name(1, "XYZAC"[i]);
      card.axes.push_back({.name = name, .channel = i});
      wiring.axes.push_back({.name = name, .channel = i, .scale = 1e-8});
    }

    wiring.clock_channel = card.clock_channel;
    wiring.clock_hz = card.clock_hz;
    wiring.latch_channel = card.latch_channel;
    wiring.edge_channel = card.edge_channel;
    simulation = open_simulation(setup, faults);
    auto link = std::make_unique<drivers::UsbipLink>(
        drivers::UsbipOptions{.port = simulation->counter_cards().front().port(),
                              .identity = drivers::identity_of(options)},
        monotonic());
    device = drivers::CounterCardDevice::create(options, std::move(link), monotonic()).value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::AxisSample>(device->samples(), heads);
  }
};

struct Environment : Simulated<drivers::EnvironmentDevice> {
  static constexpr const char* kName = "environment, Modbus TCP each 100 ms";
  static constexpr nanoseconds kPeriod = 100ms;
  static constexpr std::size_t kFirst = 2;

  explicit Environment(const Faults& faults = {}) {
    sim::SimulationSetup setup;
    setup.environment.emplace_back();
    simulation = open_simulation(setup, faults);
    drivers::EnvironmentDeviceOptions options;
    options.address = drivers::ModbusTcp{"127.0.0.1", simulation->environment().front().port()};
    options.map =
        drivers::known_map("comet-t7510", {.serial_number = sim::ModbusIdentity{}.serial_number})
            .value();
    options.period = kPeriod;
    device = drivers::EnvironmentDevice::create(options, monotonic()).value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::EnvironmentSample>(device->samples(), heads);
  }
};

struct SerialEnvironment : Simulated<drivers::EnvironmentDevice> {
  static constexpr const char* kName = "environment, Modbus RTU each 100 ms";

  explicit SerialEnvironment(const Faults& faults = {}) {
    const std::string link = fmt::format("/tmp/abbe-hil-{}-line", ::getpid());
    sim::SimulationSetup setup;
    setup.environment.push_back({.endpoint = sim::ModbusPtyEndpoint{link}});
    simulation = open_simulation(setup, faults);
    drivers::EnvironmentDeviceOptions options;
    options.address = drivers::ModbusSerial{.path = link};
    options.map =
        drivers::known_map("comet-t7510", {.serial_number = sim::ModbusIdentity{}.serial_number})
            .value();
    options.period = 100ms;
    device = drivers::EnvironmentDevice::create(options, monotonic()).value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::EnvironmentSample>(device->samples(), heads);
  }
};

struct MeasuringMachine {
  static constexpr const char* kName = "measuring machine, I++ DME, 10 positions/s";
  static constexpr nanoseconds kPeriod = 100ms;
  static constexpr std::size_t kFirst = 2;

  MeasuringMachine() {
    drivers::IppDeviceOptions options;
    options.port = server.port();
    device = drivers::IppDevice::create(options, monotonic()).value();
  }
  std::size_t pop(Heads* heads = nullptr) {
    return pop_all<protocol::AxisSample>(device->positions(), heads);
  }
  [[nodiscard]] ServedDevices::Peer peer() { return peer_of(server); }

  sim::IppDmeServer server = open_measuring_machine(monotonic().now());
  std::unique_ptr<drivers::IppDevice> device;
};

}  // namespace abbe::tests
