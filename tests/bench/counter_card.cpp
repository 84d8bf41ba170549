// The encoder path on the host: a simulated counter card in its own process, USB/IP over TCP, the
// driver, its ring and a reader. Requirement: 33,333 scans/s of 8 counters without loss, at most 10
// % of one processor for driver and ring, and ten times this rate without loss.
//   bench_counter_card [--seconds N] [--short]
// bench_counter_card --serve PORT        runs only the simulated card (for `usbip attach`), until
// killed bench_counter_card --libusb [...]      reads, by libusb, a card on a USB port or attached
// by usbip

#include <fmt/format.h>
#include <poll.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string_view>
#include <thread>

#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/drivers/usb/usbip_link.hpp"
#include "abbe/sim/usbip_server.hpp"
#include "figure.hpp"
#include "forked_task.hpp"

namespace {

using namespace abbe;
using namespace std::chrono_literals;

constexpr double kRate_hz = 100e3 / 3.0;
constexpr double kAskedShare = 0.10;
constexpr double kAskedFactor = 10.0;
constexpr double kClock_hz = 24e6;
constexpr std::array kFactors{10.0, 12.0, 15.0, 18.0, 21.0, 24.0, 27.0, 30.0};

sim::CounterCardOptions simulated_card() {
  sim::CounterCardOptions card;
  for (std::size_t axis = 0; axis < 5; ++axis) {
    const double speed_m_per_s = 0.01 * static_cast<double>(axis + 1);
    card.channels[axis].phases =
        sim::ScaleSignal{.reading =
                             [speed_m_per_s](sim::HostTime t) {
                               return speed_m_per_s * sim::ns_to_seconds(t.time_since_epoch());
                             },
                         .step = 10e-9,
                         .noise = 0.0,
                         .marks = {}};
  }

  card.channels[5].phases = sim::ClockSignal{.hz = kClock_hz};
  card.channels[6] = {sim::ClockSignal{.hz = kClock_hz}, true};
  card.channels[7].phases = sim::ProbeSignal{};
  // the scheduler may stop this process for a while; the buffer of the card is so large that it
  // does not overflow, because an overflow of the card is not what is measured
  card.fifo_bytes = 4 << 20;

  return card;
}

[[noreturn]] void play(sim::UsbipServer& server) {
  const sim::SimClock clock{1.0};
  for (;;) {
    const short events = static_cast<short>(server.wants_write() ? POLLIN | POLLOUT : POLLIN);
    std::array<pollfd, 2> fds{pollfd{server.listener_fd(), POLLIN, 0},
                              pollfd{server.client_fd(), events, 0}};
    const auto due = server.next_due();
    const auto wait =
        due == sim::HostTime::max() ? std::chrono::nanoseconds{10ms} : due - clock.now();
    const auto bounded =
        std::clamp(wait, std::chrono::nanoseconds{0}, std::chrono::nanoseconds{10ms});
    const timespec timeout{0, bounded.count()};
    ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    server.poll(clock.now());
  }
}

drivers::CounterCardOptions options(double rate_hz) {
  drivers::CounterCardOptions options;
  auto& wiring = options.receiver.wiring;
  wiring.axes = {{"X", 0, 1e-8}, {"Y", 1, 1e-8}, {"Z", 2, 1e-8}, {"A", 3, 1e-8}, {"C", 4, 1e-8}};
  wiring.clock_hz = kClock_hz;
  wiring.latch_channel = 6;
  wiring.edge_channel = 7;
  wiring.scan_rate_hz = rate_hz;
  options.sample_capacity = 1 << 18;
  options.transfers_in_flight = 64;
  return options;
}

double thread_cpu_s() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Result {
  double rate_hz = 0.0;  ///< scans read from the ring
  double share = 0.0;    ///< of one processor
  std::uint64_t scans = 0;
  std::uint64_t lost = 0;
  std::uint64_t gaps = 0;
  std::uint64_t unflagged = 0;  ///< gaps in the scan numbers without a gap flag
  std::uint64_t dropped = 0;
  std::uint64_t faults = 0;
  std::string last_fault;
  [[nodiscard]] bool clean() const {
    return scans != 0 && lost + gaps + unflagged + dropped + faults == 0;
  }
};

/// Reads the ring until `seconds` have passed since the first sample.
class Reader {
 public:
  void take(drivers::SampleRing<protocol::AxisSample>& ring) {
    const auto n = ring.pop(out_);
    for (std::size_t i = 0; i < n; ++i) {
      const auto& sample = out_[i];
      if (count_++ != 0 && sample.cycle != last_ + 1 + sample.head.lost_before) ++unflagged_;
      last_ = sample.cycle;
    }
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] std::uint64_t unflagged() const { return unflagged_; }

 private:
  std::array<protocol::AxisSample, 1024> out_{};
  std::uint64_t count_ = 0;
  std::uint64_t unflagged_ = 0;
  std::uint32_t last_ = 0;
};

/// Connects by USB/IP to the simulated card on `port`, or with port 0 by libusb to a card.
std::unique_ptr<drivers::UsbLink> make_link(std::uint16_t port,
                                            const drivers::CounterCardOptions& wanted,
                                            const drivers::TimeSource& time) {
  const auto identity = drivers::identity_of(wanted);
  if (port == 0) return std::make_unique<drivers::LibusbLink>(identity, time);
  return std::make_unique<drivers::UsbipLink>(
      drivers::UsbipOptions{.port = port, .identity = identity}, time);
}

Result measure(std::uint16_t port, double rate_hz, std::chrono::duration<double> duration) {
  const drivers::MonotonicTime time;
  const auto wanted = options(rate_hz);
  auto made = drivers::CounterCardDevice::create(wanted, make_link(port, wanted, time), time);

  if (!made) {
    fmt::print(stderr, "{}\n", made.error().text);
    std::exit(2);
  }

  auto& device = **made;
  std::atomic<bool> streaming{false}, stop{false};
  double cpu_s = 0.0, wall_s = 0.0;

  std::thread acquisition([&] {
    std::chrono::steady_clock::time_point begin;
    double cpu_at_begin_s = 0.0;
    while (!stop) {
      device.wait(50ms);
      device.receive();
      if (streaming || device.status().samples == 0) continue;
      begin = std::chrono::steady_clock::now();
      cpu_at_begin_s = thread_cpu_s();
      streaming = true;
    }
    cpu_s = thread_cpu_s() - cpu_at_begin_s;
    wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  });

  Reader reader;
  std::array<protocol::RawBlock, 64> blocks;
  const auto patience = std::chrono::steady_clock::now() + 10s;
  auto end = patience;

  for (bool begun = false; std::chrono::steady_clock::now() < end;) {
    reader.take(device.samples());
    while (device.raw().pop(blocks) == blocks.size()) {
    }
    if (!begun && streaming) {
      begun = true;
      end = std::chrono::steady_clock::now() +
            std::chrono::duration_cast<std::chrono::nanoseconds>(duration);
    }
    std::this_thread::sleep_for(250us);
  }

  stop = true;
  acquisition.join();
  reader.take(device.samples());
  const auto status = device.status();
  const auto& counters = device.receiver().counters();

  return {.rate_hz = static_cast<double>(reader.count()) / wall_s,
          .share = cpu_s / wall_s,
          .scans = reader.count(),
          .lost = counters.lost_scans,
          .gaps = status.gaps,
          .unflagged = reader.unflagged(),
          .dropped = status.dropped + status.raw_dropped,
          .faults = status.faults,
          .last_fault = status.last_fault};
}

void print(const Result& r, double asked_hz) {
  fmt::print(
      "{:>10.0f} scans/s asked, {:>10.0f} came; lost {}, gaps {}, unflagged {}, dropped {}, faults "
      "{}; "
      "{:.1f} % of one processor{}{}\n",
      asked_hz, r.rate_hz, r.lost, r.gaps, r.unflagged, r.dropped, r.faults, 100.0 * r.share,
      r.last_fault.empty() ? "" : "; ", r.last_fault);
  std::fflush(stdout);
}

int judge(std::uint16_t port, std::chrono::duration<double> duration,
          std::chrono::duration<double> trial) {
  fmt::print("counter card, 8 counters of 32 bit, {:.0f} s:\n", duration.count());
  const auto usual = measure(port, kRate_hz, duration);
  print(usual, kRate_hz);
  double highest = usual.clean() ? 1.0 : 0.0;

  for (const double factor : kFactors) {
    const auto r = measure(port, factor * kRate_hz, trial);
    print(r, factor * kRate_hz);
    if (!r.clean()) break;
    highest = factor;
  }

  using tests::print_figure;
  print_figure("encoder path on this computer", "0 lost, 0 unflagged",
               "{} scans, {} lost, {} gaps, {} unflagged", usual.scans, usual.lost, usual.gaps,
               usual.unflagged);
  print_figure("encoder path, driver and ring", fmt::format("<= {:.0f} %", 100.0 * kAskedShare),
               "{:.1f} % of one processor", 100.0 * usual.share);
  print_figure("encoder path, highest rate without loss",
               fmt::format(">= {:.0f} x 33,333", kAskedFactor), "{:.0f} scans/s, {:.0f} x 33,333",
               highest * kRate_hz, highest);

  return usual.clean() && usual.share <= kAskedShare && highest >= kAskedFactor ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::chrono::duration<double> duration{10.0};
  std::chrono::duration<double> trial{3.0};
  std::uint16_t serve_at = 0;
  bool by_libusb = false;

  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--short") {
      duration = trial = std::chrono::duration<double>{1.0};
    } else if (word == "--libusb") {
      by_libusb = true;
    } else if (word == "--seconds" && more) {
      duration = std::chrono::duration<double>{std::atof(argv[++i])};
    } else if (word == "--serve" && more) {
      serve_at = static_cast<std::uint16_t>(std::atoi(argv[++i]));
    } else {
      fmt::print(stderr,
                 "usage: bench_counter_card [--seconds N] [--short] [--libusb | --serve PORT]\n");
      return 2;
    }
  }

  auto server = sim::UsbipServer::open(serve_at, simulated_card());
  if (!server) {
    fmt::print(stderr, "{}\n", server.error().text);
    return 2;
  }

  if (serve_at != 0) play(*server);
  bench::ForkedTask card([&] { play(*server); });
  card.begin();

  return judge(by_libusb ? std::uint16_t{0} : server->port(), duration, trial);
}
