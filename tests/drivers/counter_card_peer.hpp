#pragma once
/// A counter card driver and the simulated card behind a real TCP connection, in one thread and one
/// stepped time. X runs at 20 mm/s, Y stands; the clock counts 1 MHz.

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <vector>

#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"
#include "abbe/sim/usbip_server.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {

using namespace std::chrono_literals;

inline constexpr double kSpeed_m_per_s = 0.02;
inline constexpr double kStep_m = 1e-8;
inline constexpr double kClock_hz = 1e6;

inline drivers::CounterCardWiring card_wiring() {
  drivers::CounterCardWiring wiring;
  wiring.axes = {{.name = "X", .channel = 0, .scale = kStep_m},
                 {.name = "Y", .channel = 1, .scale = kStep_m}};
  wiring.clock_channel = 5;
  wiring.clock_hz = kClock_hz;
  wiring.latch_channel = 6;
  wiring.scan_rate_hz = 40e3;
  return wiring;
}

inline sim::CounterCardOptions simulated_card() {
  sim::CounterCardOptions card;
  card.channels[0].phases =
      sim::ScaleSignal{.reading =
                           [](sim::HostTime t) {
                             return kSpeed_m_per_s * sim::ns_to_seconds(t - sim::HostTime{1h});
                           },
                       .step = kStep_m,
                       .noise = 0.0,
                       .marks = {}};
  card.channels[1].phases = sim::ScaleSignal{.step = kStep_m};
  card.channels[5].phases = sim::ClockSignal{.hz = kClock_hz};
  card.channels[6] = {sim::ClockSignal{.hz = kClock_hz}, true};
  card.channels[7].phases = sim::ProbeSignal{};

  return card;
}

/// Keeps what the device saw, for tests of single scans.
class ScanKeeper final : public drivers::CounterScanSink {
 public:
  ScanKeeper() { scans.reserve(100'000); }
  void on_scan(const drivers::CounterScan& scan) ABBE_RT override {
    if (scans.size() < scans.capacity()) scans.push_back(scan);
  }
  std::vector<drivers::CounterScan> scans;
};

class CardBench {
 public:
  explicit CardBench(drivers::CounterCardOptions options = default_options(),
                     sim::CounterCardOptions card = simulated_card())
      : server(std::move(*sim::UsbipServer::open(0, card))) {
    auto link = std::make_unique<drivers::UsbipLink>(
        drivers::UsbipOptions{.port = server.port(), .identity = drivers::identity_of(options)},
        time);
    auto made = drivers::CounterCardDevice::create(options, std::move(link), time, &keeper);
    EXPECT_TRUE(made.has_value()) << made.error().text;
    device = std::move(*made);
  }

  static drivers::CounterCardOptions default_options() {
    drivers::CounterCardOptions options;
    options.receiver.wiring = card_wiring();
    options.transfer_time = 500us;  // one packet
    return options;
  }

  void cycle() {
    server.poll(time.now());
    device->wait(kCycle);
    device->receive();
    time.advance(kCycle);
  }
  /// Runs cycles until `done()`; false after `limit` of host time.
  template <class Done>
  bool until(Done done, std::chrono::nanoseconds limit = 3s) {
    for (const auto end = time.now() + limit; !done();) {
      if (time.now() >= end) return false;
      cycle();
    }
    return true;
  }
  void cycles_for(std::chrono::nanoseconds duration) {
    for (const auto end = time.now() + duration; time.now() < end;) cycle();
  }
  bool streams() {
    return until([this] { return device->status().samples != 0; });
  }
  std::vector<protocol::AxisSample> take_samples() {
    std::vector<protocol::AxisSample> all;
    std::array<protocol::AxisSample, 256> out{};
    while (const auto n = device->samples().pop(out))
      all.insert(all.end(), out.begin(), out.begin() + n);
    return all;
  }

  static constexpr std::chrono::nanoseconds kCycle = 250us;
  SteppedTime time;
  sim::UsbipServer server;
  ScanKeeper keeper;
  std::unique_ptr<drivers::CounterCardDevice> device;
};

}  // namespace abbe::tests
