// Five axes and their SYNC at 1 kHz over UDP, for as long as wanted: in the guest, in virtual time,
// and by scripts/soak also on this computer and in its own time, where other work, or a hypervisor
// that takes the processor away for more than a period, may fail it.
//
// ABBE_HIL_SECONDS: default 5.

#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/drivers/real_time_memory.hpp"
#include "bare_period.hpp"
#include "figure.hpp"
#include "run_time.hpp"
#include "simulated_encoders.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kAxes = 5;

TEST(FiveAxesOverUdp, AreNeverMissing) {
  EXPECT_TRUE(::geteuid() != 0 || drivers::lock_memory().empty());
  drivers::MonotonicTime time;
  const int first = ::geteuid() == 0 ? 90 : 0;
  const SimulatedEncoders encoders{sim::CanPortOptions{.speed = 1.0}, kAxes, first};
  drivers::EncoderDeviceOptions options;
  options.receiver.axes = SimulatedEncoders::axes(kAxes);
  auto device = std::move(*drivers::EncoderDevice::create(
      options,
      std::make_unique<drivers::UdpCanBus>(drivers::UdpCanOptions{.peer_port = encoders.port()},
                                           time),
      time));
  const auto thread =
      std::move(*drivers::DeviceThread::start(*device, {.name = "encoders", .priority = 50}));

  std::vector<protocol::AxisSample> some(4096);
  std::vector<protocol::RawBlock> blocks(4096);  // too much for a stack
  std::size_t samples = 0;
  std::size_t incomplete = 0;
  std::uint64_t lost = 0;
  const auto take = [&](bool count) {
    const auto n = device->samples().pop(some);
    device->raw().pop(blocks);
    for (std::size_t i = 0; count && i < n; ++i) {
      ++samples;
      incomplete += some[i].missing_mask != 0 ? 1 : 0;
      lost += some[i].head.lost_before;
    }
  };
  for (int i = 0; i < 500 && device->status().state != "streaming"; ++i, ::usleep(10'000))
    take(false);
  ASSERT_EQ(device->status().state, "streaming") << device->status().last_fault;
  ::usleep(100'000);
  take(false);
  const auto asked = run_time(5s);
  BarePeriod computer{first};
  for (const auto end = time.now() + asked; time.now() < end; ::usleep(20'000)) take(true);
  computer.stop();
  print_figure("5 axes + SYNC at 1 kHz over UDP", "0 lost, 0 incomplete",
               "{} samples, {} lost, {} incomplete", samples, lost, incomplete);
  print_figure("  a bare thread beside it", "-", "{} of {} periods more than 0.8 ms late",
               computer.late(), computer.periods());
  EXPECT_GE(samples + 50, static_cast<std::size_t>(asked / 1ms));
  EXPECT_EQ(incomplete, 0u);
  EXPECT_EQ(lost, 0u);
  EXPECT_EQ(device->status().dropped, 0u);
}

}  // namespace
}  // namespace abbe::tests
