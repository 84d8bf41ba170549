// Deadlines of the drivers behind TCP in virtual time, as deadlines_test.cpp has them for the encoders: from
// when the simulated device wrote its bytes until their samples are in the ring.
//
// ABBE_HIL_SECONDS: virtual seconds of each run (default 5).

#include <gtest/gtest.h>

#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/known_maps.hpp"
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/drivers/tracker/device.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"
#include "abbe/sim/ippdme_server.hpp"
#include "abbe/sim/simulation.hpp"
#include "busy_world.hpp"
#include "figure.hpp"
#include "locked_memory.hpp"
#include "run_time.hpp"
#include "served_devices.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using std::chrono::nanoseconds;

constexpr int kDevicePriority = 50;
constexpr int kPeerPriority = 90;  // hardware would take no processor time at all

const drivers::MonotonicTime& monotonic() {
  static const drivers::MonotonicTime time;
  return time;
}

std::unique_ptr<sim::Simulation> open_simulation(sim::SimulationSetup setup) {
  setup.path.vertices = {{{0, 0, 0}}, {{0.2, 0.1, 0}}, {{0, 0, 0}}};
  setup.start_when_streaming = false;
  return sim::Simulation::open(setup, monotonic().now()).value();
}
ServedDevices::Peer peer_of(sim::Simulation& simulation) {
  return {[&](auto& fds) { simulation.add_poll_fds(fds); }, [&] { return simulation.next_due(); },
          [&](HostTime now) { simulation.poll(now); }};
}

struct Tracker {
  static constexpr const char* kName = "tracker, 500 points/s";
  static constexpr nanoseconds kPeriod = 2ms;
  static constexpr std::size_t kFirst = 200;

  Tracker() {
    sim::SimulationSetup setup;
    setup.tracker.emplace();
    setup.tracker->initialize_time = 100ms;
    simulation = open_simulation(setup);
    drivers::TrackerDeviceOptions options;
    options.host = "127.0.0.1";
    options.port = simulation->tracker()->port();
    device = drivers::TrackerDevice::create(options, monotonic()).value();
  }
  std::size_t pop() {
    std::array<protocol::TrackerPoint, 256> some{};
    return device->points().pop(some);
  }
  [[nodiscard]] ServedDevices::Peer peer() const { return peer_of(*simulation); }

  std::unique_ptr<sim::Simulation> simulation;
  std::unique_ptr<drivers::TrackerDevice> device;
};

struct CounterCard {
  static constexpr const char* kName = "counter card, USB/IP in the process, a transfer each 1.5 ms";
  static constexpr nanoseconds kPeriod = 1500us;
  static constexpr std::size_t kFirst = 2000;

  CounterCard() {
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
    simulation = open_simulation(setup);
    auto link = std::make_unique<drivers::UsbipLink>(
        drivers::UsbipOptions{.port = simulation->counter_cards().front().port(),
                              .identity = drivers::identity_of(options)},
        monotonic());
    device = drivers::CounterCardDevice::create(options, std::move(link), monotonic()).value();
  }
  std::size_t pop() {
    std::array<protocol::AxisSample, 256> some;  // NOLINT: filled by pop
    std::size_t all = 0;
    for (std::size_t n = some.size(); n == some.size(); all += n) n = device->samples().pop(some);
    return all;
  }
  [[nodiscard]] ServedDevices::Peer peer() const { return peer_of(*simulation); }

  std::unique_ptr<sim::Simulation> simulation;
  std::unique_ptr<drivers::CounterCardDevice> device;
};

struct Environment {
  static constexpr const char* kName = "environment, Modbus TCP each 100 ms";
  static constexpr nanoseconds kPeriod = 100ms;
  static constexpr std::size_t kFirst = 2;

  Environment() {
    sim::SimulationSetup setup;
    setup.environment.emplace_back();
    simulation = open_simulation(setup);
    drivers::EnvironmentDeviceOptions options;
    options.address = drivers::ModbusTcp{"127.0.0.1", simulation->environment().front().port()};
    options.map =
        drivers::known_map("comet-t7510", {.serial_number = sim::ModbusIdentity{}.serial_number}).value();
    options.period = kPeriod;
    device = drivers::EnvironmentDevice::create(options, monotonic()).value();
  }
  std::size_t pop() {
    std::array<protocol::EnvironmentSample, 64> some{};
    return device->samples().pop(some);
  }
  [[nodiscard]] ServedDevices::Peer peer() const { return peer_of(*simulation); }

  std::unique_ptr<sim::Simulation> simulation;
  std::unique_ptr<drivers::EnvironmentDevice> device;
};

struct MeasuringMachine {
  static constexpr const char* kName = "measuring machine, I++ DME, 10 positions/s";
  static constexpr nanoseconds kPeriod = 100ms;
  static constexpr std::size_t kFirst = 2;

  MeasuringMachine() {
    server = std::make_unique<sim::IppDmeServer>(
        sim::IppDmeServer::open(0,
                                std::make_unique<sim::IppDmeDevice>(sim::IppDmeOptions{}, monotonic().now()))
            .value());
    drivers::IppDeviceOptions options;
    options.port = server->port();
    device = drivers::IppDevice::create(options, monotonic()).value();
  }
  std::size_t pop() {
    std::array<protocol::AxisSample, 64> some{};
    return device->positions().pop(some);
  }
  [[nodiscard]] ServedDevices::Peer peer() const {
    return {[this](auto& fds) {
              fds.push_back({server->listener_fd(), POLLIN, 0});
              if (server->client_fd() >= 0) fds.push_back({server->client_fd(), POLLIN, 0});
            },
            [this] { return server->next_due(); }, [this](HostTime now) { server->poll(now); }};
  }

  std::unique_ptr<sim::IppDmeServer> server;
  std::unique_ptr<drivers::IppDevice> device;
};

/// The device thread's loop with a look at the clock after each turn.
template <class Driver>
class MeasuredDriver {
 public:
  MeasuredDriver() {
    times_.reserve(static_cast<std::size_t>(run_time(5s) / Driver::kPeriod) * 4 + 1000);
    thread_ = std::thread([this] { turns(); });
  }
  ~MeasuredDriver() { stop(); }
  MeasuredDriver(const MeasuredDriver&) = delete;
  MeasuredDriver& operator=(const MeasuredDriver&) = delete;

  [[nodiscard]] bool streams() const {
    for (int i = 0; i < 1000 && samples_ < Driver::kFirst; ++i) ::usleep(10'000);
    return samples_ >= Driver::kFirst;
  }
  void begin_to_measure() { measuring_ = true; }
  [[nodiscard]] drivers::DeviceStatus status() const { return driver_.device->status(); }
  std::vector<nanoseconds>& stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return times_;
  }

 private:
  void turns() {
    const sched_param param{.sched_priority = kDevicePriority};
    EXPECT_EQ(pthread_setschedparam(pthread_self(), SCHED_FIFO, &param), 0);
    while (!stop_) {
      driver_.device->wait(50ms);
      driver_.device->receive();
      look(monotonic().now());
    }
  }
  void look(HostTime now) {
    std::array<protocol::RawBlock, 32> blocks;  // NOLINT: filled by pop
    bool came = false;
    for (std::size_t n = blocks.size(); n == blocks.size();) {
      n = driver_.device->raw().pop(blocks);
      for (std::size_t i = 0; i < n; ++i)
        came |= blocks[i].direction == protocol::RawBlock::Direction::FromDevice && blocks[i].length != 0;
    }
    const auto n = driver_.pop();
    samples_ = samples_ + n;
    if (!came) return;
    // More bytes of one write may come in a later turn: they are as old.
    if (const auto written = peer_.take_written()) written_ = *written;
    if (n != 0 && measuring_ && written_ != HostTime{}) times_.push_back(now - written_);
  }

  Driver driver_;
  ServedDevices peer_{driver_.peer(), kPeerPriority};
  std::vector<nanoseconds> times_;  ///< the device thread's until it has ended
  HostTime written_{};
  std::atomic<std::size_t> samples_{0};
  std::atomic<bool> measuring_{false};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

double us(nanoseconds t) {
  return std::chrono::duration<double, std::micro>(t).count();
}

template <class Driver>
class DriverDeadlines : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(lock_memory()); }

  void expect_samples_within_a_period(bool busy) {
    const BusyWorld world{busy};
    MeasuredDriver<Driver> driver;
    ASSERT_TRUE(driver.streams()) << driver.status().last_fault;
    ::usleep(500'000);  // the kernel cleans up after whoever ran before
    const auto before = driver.status();
    driver.begin_to_measure();
    ::usleep(static_cast<useconds_t>(run_time(5s) / 1us));
    const auto after = driver.status();
    auto times = driver.stop();
    ASSERT_FALSE(times.empty());
    std::sort(times.begin(), times.end());
    print_figure(
        fmt::format("{}, {}: data written to samples in ring", Driver::kName, busy ? "busy" : "idle"),
        fmt::format("1 period, {:.0f} us", us(Driver::kPeriod)),
        "n {}, median {:.0f} us, p99.9 {:.0f} us, max {:.0f} us, {} gaps", times.size(),
        us(times[times.size() / 2]), us(times[times.size() * 999 / 1000]), us(times.back()),
        after.gaps - before.gaps);
    EXPECT_LT(times.back(), Driver::kPeriod);
    EXPECT_EQ(after.gaps, before.gaps);
    EXPECT_EQ(after.faults, before.faults) << after.last_fault;
    EXPECT_EQ(after.dropped, before.dropped);
  }
};

using Drivers = testing::Types<Tracker, CounterCard, Environment, MeasuringMachine>;
TYPED_TEST_SUITE(DriverDeadlines, Drivers);

TYPED_TEST(DriverDeadlines, HoldOnAnIdleComputer) {
  this->expect_samples_within_a_period(false);
}
TYPED_TEST(DriverDeadlines, HoldOnABusyComputer) {
  this->expect_samples_within_a_period(true);
}

}  // namespace
}  // namespace abbe::tests
