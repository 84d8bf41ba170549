// A counter card in the daemon's set of devices, over the wire: configured as a person would,
// played by the simulator in a thread of its own, in real time.

#include <gmock/gmock.h>
#include <poll.h>

#include <atomic>
#include <string>
#include <thread>

#include "abbe/config/config.hpp"
#include "abbe/devices/device_set.hpp"
#include "abbe/sim/usbip_server.hpp"
#include "config_tables.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::HasSubstr;

class CardInAThread {
 public:
  CardInAThread()
      : server_(std::move(*sim::UsbipServer::open(0, card()))), thread_([this] { run(); }) {}
  CardInAThread(const CardInAThread&) = delete;
  CardInAThread& operator=(const CardInAThread&) = delete;
  ~CardInAThread() {
    stop_ = true;
    thread_.join();
  }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

 private:
  static sim::CounterCardOptions card() {
    sim::CounterCardOptions card;
    card.channels[0].phases = sim::ScaleSignal{
        .reading = [](sim::HostTime t) { return 0.01 * sim::ns_to_seconds(t.time_since_epoch()); },
        .step = 1e-8,
        .noise = 0.0,
        .marks = {}};
    card.channels[1].phases = sim::ScaleSignal{.step = 1e-6};
    card.channels[5].phases = sim::ClockSignal{.hz = 1e6};
    return card;
  }
  void run() {
    const sim::SimClock clock{1.0};
    while (!stop_) {
      pollfd fds[2] = {{server_.listener_fd(), POLLIN, 0}, {server_.client_fd(), POLLIN, 0}};
      ::poll(fds, 2, 1);
      server_.poll(clock.now());
    }
  }

  sim::UsbipServer server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

Config configuration(std::uint16_t port, const std::string& serial_number = "01ABBE08") {
  const std::string text = to_toml(config_tables::mill()) + std::string(R"([counter_card]
transport = "usbip"
port = )") + std::to_string(port) +
                           "\nserial_number = \"" + serial_number + R"("
clock_MHz = 1
latch_channel = 6
scan_rate_hz = 2000
axes = [{axis = "X", channel = 0, step_nm = 10, offset_mm = -120}, {axis = "Y", channel = 1, step_nm = 1000, offset_mm = 3},
        {axis = "Z", channel = 2, step_nm = 1000}]
)";
  auto config = parse_config(text, "abbed.toml");
  EXPECT_TRUE(config) << config.error().details.front();
  return *config;
}

TEST(CounterCardDevices, GiveTheAxesOfTheConfiguration) {
  CardInAThread card;
  const auto config = configuration(card.port());
  const drivers::MonotonicTime time;
  auto devices = DeviceSet::start(config, time);
  ASSERT_TRUE(devices) << devices.error().text;
  Batch batch;
  const auto patience = time.now() + 20s;

  while (batch.axes.size() < 500 && time.now() < patience) {
    devices->drain(batch);
    std::this_thread::sleep_for(1ms);
  }

  ASSERT_GE(batch.axes.size(), 500u) << devices->health(time.now()).front().status.last_fault;
  const auto& first = batch.axes.front();
  const auto& last = batch.axes.back();
  EXPECT_NEAR(first.position[0], -0.12, 5e-3) << "count 0 is where it stood when it was set up";
  EXPECT_DOUBLE_EQ(last.position[1], 0.003);
  const double seconds = (last.cycle - first.cycle) / 2000.0;  // by the card's own pacer
  EXPECT_NEAR(last.position[0] - first.position[0], 0.01 * seconds, 2e-8)
      << "rounded to a count of 10 nm";
  EXPECT_FALSE(batch.raw.empty());
  EXPECT_EQ(devices->health(time.now()).front().status.name, "counter_card");
  EXPECT_THAT(devices->warnings(), Contains(HasSubstr("not yet verified on hardware")));
}

TEST(CounterCardDevices, ReportTheNameOfACardThatIsNotTheConfiguredOne) {
  CardInAThread card;
  const drivers::MonotonicTime time;
  auto devices = DeviceSet::start(configuration(card.port(), "01C0FFEE"), time);
  ASSERT_TRUE(devices) << devices.error().text;
  std::string fault;
  const auto patience = time.now() + 20s;

  while (fault.empty() && time.now() < patience) {
    fault = devices->health(time.now()).front().status.last_fault;
    std::this_thread::sleep_for(1ms);
  }

  EXPECT_THAT(fault, HasSubstr("its serial number is \"01ABBE08\", configured is \"01C0FFEE\""));
  Batch batch;
  devices->drain(batch);
  EXPECT_TRUE(batch.axes.empty());
}

}  // namespace
}  // namespace abbe::daemon
