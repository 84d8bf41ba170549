// The counter card driver through libusb and the kernel's USB stack: the simulated card's USB/IP
// server attached by vhci_hcd, and an unplug as dummy_hcd shows it. In virtual time where a rate is
// asserted. Needs udev for hot-plug.
//
// ABBE_HIL_SECONDS: of the streaming run (default 3).

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <thread>

#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/protocol/usbip/operations.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/usbip_server.hpp"
#include "can_interface.hpp"
#include "figure.hpp"
#include "run_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
namespace usbip = protocol::usbip;
using testing::HasSubstr;

constexpr const char* kAttach = "/sys/devices/platform/vhci_hcd.0/attach";
constexpr const char* kGadget =
    "/sys/kernel/config/usb_gadget/abbe/UDC";  // nothing in it: unplugged
constexpr const char* kDetach = "/sys/devices/platform/vhci_hcd.0/detach";
constexpr double kScans_hz = 100e3 / 3.0;
constexpr double kClock_hz = 1e6;
constexpr double kStep_m = 1e-8;

/// All eight counters in use: five axes, the clock, the probe's latch and its edges.
drivers::CounterCardOptions eight_counters() {
  drivers::CounterCardOptions options;
  auto& wiring = options.receiver.wiring;
  for (std::uint8_t i = 0; i < 5; ++i) {
    wiring.axes.push_back({.name = std::string(1, "XYZAC"[i]), .channel = i, .scale = kStep_m});
  }
  wiring.clock_channel = 5;
  wiring.clock_hz = kClock_hz;
  wiring.latch_channel = 6;
  wiring.edge_channel = 7;
  wiring.scan_rate_hz = kScans_hz;
  return options;
}

sim::CounterCardOptions card_of_a_moving_machine(double speed_m_per_s) {
  sim::CounterCardOptions card;
  for (std::size_t i = 0; i < 5; ++i) {
    card.channels[i].phases =
        sim::ScaleSignal{.reading =
                             [speed_m_per_s](sim::HostTime t) {
                               return speed_m_per_s * sim::ns_to_seconds(t.time_since_epoch());
                             },
                         .step = kStep_m};
  }

  card.channels[5].phases = sim::ClockSignal{.hz = kClock_hz};
  card.channels[6] = {sim::ClockSignal{.hz = kClock_hz}, true};
  card.channels[7].phases = sim::ProbeSignal{};

  return card;
}

/// The simulated card with a thread of its own, above everything that is measured.
class SimulatedCard {
 public:
  SimulatedCard() : server_(std::move(*sim::UsbipServer::open(0, card_of_a_moving_machine(0.02)))) {
    thread_ = std::thread([this] {
      const sched_param param{.sched_priority = 90};
      EXPECT_EQ(pthread_setschedparam(pthread_self(), SCHED_FIFO, &param), 0);
      serve();
    });
  }
  ~SimulatedCard() {
    stop_ = true;
    thread_.join();
  }
  SimulatedCard(const SimulatedCard&) = delete;
  SimulatedCard& operator=(const SimulatedCard&) = delete;

  void pull() { pulled_ = true; }
  void push_in() { pulled_ = false; }
  [[nodiscard]] std::uint16_t port() const { return server_.port(); }

 private:
  void serve() {
    bool out = false;
    while (!stop_) {
      std::vector<pollfd> fds{{server_.listener_fd(), POLLIN, 0}};
      if (server_.client_fd() >= 0) {
        fds.push_back({server_.client_fd(),
                       static_cast<short>(server_.wants_write() ? POLLIN | POLLOUT : POLLIN), 0});
      }
      const auto wait =
          std::clamp(server_.next_due() - clock_.now(), 0ns, std::chrono::nanoseconds{5ms});
      const timespec timeout{0, static_cast<long>(wait.count())};
      ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
      if (pulled_ != out) {
        out = !out;
        out ? server_.plug_out() : server_.plug_in();
      }
      server_.poll(clock_.now());
    }
  }

  sim::SimClock clock_{1.0};
  sim::UsbipServer server_;
  std::atomic<bool> pulled_{false};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

double ms(std::chrono::nanoseconds t) {
  return std::chrono::duration<double, std::milli>(t).count();
}

/// What `usbip attach` does: imports the device, then hands the connection to the kernel.
::testing::AssertionResult attach(std::uint16_t tcp_port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(tcp_port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return ::testing::AssertionFailure() << "connect";
  std::array<std::byte, usbip::kImportReplySize> bytes{};
  const auto size = usbip::encode_import_request(usbip::BusId{"1-1"}, bytes);
  if (::send(fd, bytes.data(), size, 0) != static_cast<ssize_t>(size))
    return ::testing::AssertionFailure() << "send";
  if (::recv(fd, bytes.data(), bytes.size(), MSG_WAITALL) != static_cast<ssize_t>(bytes.size()))
    return ::testing::AssertionFailure() << "the server refuses the import";
  const auto reply = usbip::decode_import_reply(bytes);
  if (!reply) return ::testing::AssertionFailure() << to_text(reply.error());
  std::ofstream file{kAttach};
  file << fmt::format("0 {} {} {}", fd, usbip::device_id(reply->device),
                      static_cast<unsigned>(reply->device.speed));
  file.close();
  ::close(fd);  // the kernel holds it now

  return file ? ::testing::AssertionSuccess()
              : ::testing::AssertionFailure() << "vhci_hcd refuses the connection";
}
void detach() {
  std::ofstream{kDetach} << "0";
}

class CardThroughLibusb : public testing::Test {
 protected:
  CardThroughLibusb() {
    const auto options = eight_counters();
    device = std::move(*drivers::CounterCardDevice::create(
        options, std::make_unique<drivers::LibusbLink>(drivers::identity_of(options), time), time));
    thread = std::move(*drivers::DeviceThread::start(*device, {.name = "card", .priority = 50}));
  }
  ~CardThroughLibusb() override {
    thread.reset();
    detach();
    ::usleep(300'000);
  }
  void take() {
    std::array<protocol::AxisSample, 8192> some;  // NOLINT: filled by pop
    for (std::size_t n = some.size(); n == some.size();) {
      n = device->samples().pop(some);
      for (std::size_t i = 0; i < n; ++i) {
        flags |= some[i].head.flags;
        lost += some[i].head.lost_before;
      }
      samples += n;
    }
    std::array<protocol::RawBlock, 1024> blocks;  // NOLINT: filled by pop
    while (device->raw().pop(blocks) == blocks.size()) {
    }
  }
  template <class Done>
  bool until(Done done, std::chrono::seconds limit = 20s) {
    for (const auto end = time.now() + limit; !done(); ::usleep(20'000)) {
      if (time.now() >= end) return false;
      take();
    }
    return true;
  }
  bool streams() {
    const auto before = samples;
    return until([&] { return samples > before + 1000 && device->status().connected; });
  }

  drivers::MonotonicTime time;
  SimulatedCard card;
  std::unique_ptr<drivers::CounterCardDevice> device;
  std::unique_ptr<drivers::DeviceThread> thread;
  std::size_t samples = 0;
  std::uint64_t lost = 0;
  protocol::SampleFlags flags = 0;
};

TEST_F(CardThroughLibusb, GivesEveryScanOfEightCountersAt33kHz) {
  ASSERT_TRUE(attach(card.port()));
  ASSERT_TRUE(streams()) << device->status().last_fault;
  take();
  const auto before = device->status();
  samples = 0;
  lost = 0;
  const auto begin = time.now();
  for (const auto end = begin + run_time(3s); time.now() < end; ::usleep(20'000)) take();
  const double rate_hz =
      static_cast<double>(samples) / std::chrono::duration<double>(time.now() - begin).count();
  const auto after = device->status();
  print_figure("encoder path, 8 counters through libusb and vhci_hcd",
               "33333/s, 0 lost, 0 unflagged gaps", "{} scans, {:.0f}/s, {} lost, {} gaps", samples,
               rate_hz, lost, after.gaps - before.gaps);

  EXPECT_NEAR(rate_hz, kScans_hz,
              0.02 * kScans_hz);  // the last transfer is not complete; time of the reading
  EXPECT_EQ(lost, 0u);
  EXPECT_EQ(after.gaps, before.gaps);
  EXPECT_EQ(after.dropped, 0u);
  EXPECT_EQ(after.faults, before.faults) << after.last_fault;
}

TEST_F(CardThroughLibusb, IsLostWhenItsConnectionBreaksAndStreamsWhenItIsBack) {
  ASSERT_TRUE(attach(card.port()));
  ASSERT_TRUE(streams()) << device->status().last_fault;
  card.pull();
  const auto pulled = time.now();

  ASSERT_TRUE(until([&] { return !device->status().connected; }));
  print_figure("USB connection broken to fault", "100 ms", "{:.0f} ms", ms(time.now() - pulled));
  EXPECT_NE(device->status().last_fault, "");
  ::usleep(500'000);
  flags = 0;
  card.push_in();
  ::usleep(100'000);
  ASSERT_TRUE(attach(card.port()));
  const auto attached = time.now();
  ASSERT_TRUE(streams()) << device->status().last_fault;
  print_figure("USB attached to 1000 scans", "1 s after the kernel's enumeration", "{:.0f} ms",
               ms(time.now() - attached));
  EXPECT_NE(flags & (protocol::SampleFlag::Restarted | protocol::SampleFlag::GapBefore), 0u);
}

/// A gadget of the kernel itself, unplugged by taking it off its controller: transfers fail first,
/// the notice comes after.
TEST(LibusbLinkOnDummyHcd, ReportsAnUnplug) {
  ASSERT_TRUE(run("tests/hil/guest/plug-gadget"));
  drivers::MonotonicTime time;
  drivers::LibusbLink link{
      {.vendor = 0x1209, .product = 0x0002, .serial = "", .bulk_endpoint = 0x81}, time};
  std::size_t bytes = 0;
  bool opened = false;
  std::optional<std::string> lost;

  const auto serve = [&](auto done) {
    for (const auto end = time.now() + 10s; !done() && time.now() < end;) {
      for (const auto& event : link.wait(50ms)) {
        opened |= std::holds_alternative<drivers::UsbOpened>(event);
        if (const auto* bulk = std::get_if<drivers::UsbBulkIn>(&event)) bytes += bulk->bytes.size();
        if (const auto* gone = std::get_if<drivers::UsbLost>(&event)) lost = gone->error.text;
      }
      if (lost && !opened) {  // not enumerated yet
        lost.reset();
        link.open();
      }
    }
    return done();
  };

  link.open();
  ASSERT_TRUE(serve([&] { return opened; }));
  link.start_bulk_in({.transfer_bytes = 4096, .in_flight = 8});
  ASSERT_TRUE(serve([&] { return bytes > 100'000; }));
  const auto unplugged = time.now();
  std::ofstream{kGadget} << "\n" << std::flush;
  ASSERT_TRUE(serve([&] { return lost.has_value(); }));
  print_figure("USB unplug on dummy_hcd to loss", "100 ms", "{:.0f} ms: {}",
               ms(time.now() - unplugged), *lost);
  EXPECT_NE(*lost, "");
}

}  // namespace
}  // namespace abbe::tests
