// Deadlines of the encoder path in virtual time: the guest's clock counts instructions of a
// processor of some 500 MIPS, so a delay here comes from the driver's logic, queues and scheduling,
// not from other load. It is no measure of the latency of real hardware. Every peer runs in
// the guest; the simulated nodes run above the device thread, because hardware would take no
// processor time at all.
//
// ABBE_HIL_SECONDS: virtual seconds of each run (default 5).

#include <fmt/format.h>

#include <algorithm>

#include "abbe/drivers/can/socket_can_bus.hpp"
#include "abbe/drivers/real_time_memory.hpp"
#include "busy_world.hpp"
#include "figure.hpp"
#include "run_time.hpp"
#include "simulated_encoders.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::SyncSource;
using protocol::AxisSample;
using protocol::HostTime;
using protocol::RawBlock;
using protocol::SampleFlag;
using sim::FaultKind;
using std::chrono::nanoseconds;

constexpr std::size_t kAxes = 5;
constexpr nanoseconds kPeriod = 1ms;
constexpr int kDevicePriority = 50;
constexpr int kNodePriority = 90;

double us(nanoseconds t) {
  return std::chrono::duration<double, std::micro>(t).count();
}

/// What the device thread measured of its own cycles. Filled by that thread, read when it has
/// ended.
struct Seen {
  std::vector<AxisSample> samples;
  std::vector<nanoseconds>
      ready_to_ring;  ///< oldest frame of a cycle in the kernel until its samples are out
  std::vector<nanoseconds> sync_to_flag;  ///< SYNC to the sample that marks an axis as missing
};

/// The device thread's loop with a look at the clock after each cycle.
class MeasuredDevice {
 public:
  MeasuredDevice(const CanInterface& interface, SyncSource sync) {
    drivers::EncoderDeviceOptions options;
    options.receiver.axes = SimulatedEncoders::axes(kAxes);
    options.receiver.sync_period = kPeriod;
    options.sync = sync;
    device_ = std::move(*drivers::EncoderDevice::create(
        options,
        std::make_unique<drivers::SocketCanBus>(
            drivers::SocketCanOptions{.interface = interface.name()}, time_),
        time_));
    const auto room = static_cast<std::size_t>(run_time(5s) / kPeriod) * 2 + 10'000;
    seen_.samples.reserve(room);
    seen_.ready_to_ring.reserve(2 * room);
    seen_.sync_to_flag.reserve(room);
    thread_ = std::thread([this] { turns(); });
  }
  ~MeasuredDevice() { stop(); }
  MeasuredDevice(const MeasuredDevice&) = delete;
  MeasuredDevice& operator=(const MeasuredDevice&) = delete;

  [[nodiscard]] bool state_becomes(std::string_view state) const {
    for (int i = 0; i < 1000 && device_->status().state != state; ++i) ::usleep(10'000);
    return device_->status().state == state;
  }
  void begin_to_measure() { measuring_ = true; }
  const Seen& stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return seen_;
  }
  [[nodiscard]] drivers::DeviceStatus status() const { return device_->status(); }

 private:
  void turns() {
    const sched_param param{.sched_priority = kDevicePriority};
    EXPECT_EQ(pthread_setschedparam(pthread_self(), SCHED_FIFO, &param), 0);
    while (!stop_) {
      device_->wait(50ms);
      device_->receive();
      look(time_.now());
    }
  }
  void look(HostTime now) {
    std::array<RawBlock, 64> blocks;  // NOLINT: filled by pop
    std::optional<HostTime> oldest;
    for (std::size_t n = blocks.size(); n == blocks.size();) {
      n = device_->raw().pop(blocks);
      for (std::size_t i = 0; i < n; ++i) {
        const bool came =
            blocks[i].direction == RawBlock::Direction::FromDevice && blocks[i].length != 0;
        if (came && !oldest) oldest = blocks[i].time;
      }
    }

    std::array<AxisSample, 64> some{};
    const auto n = device_->samples().pop(some);
    if (!measuring_) return;
    if (oldest) seen_.ready_to_ring.push_back(now - *oldest);

    for (std::size_t i = 0; i < n; ++i) {
      seen_.samples.push_back(some[i]);
      if (some[i].missing_mask != 0) seen_.sync_to_flag.push_back(now - some[i].head.time);
    }
  }

  drivers::MonotonicTime time_;
  std::unique_ptr<drivers::EncoderDevice> device_;
  Seen seen_;
  std::atomic<bool> measuring_{false};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

struct Case {
  SyncSource sync;
  bool busy;
};

class DeadlinesInVirtualTime : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override { ASSERT_TRUE(drivers::lock_memory().empty()); }
  void begin() {
    ASSERT_TRUE(device.state_becomes("streaming")) << device.status().last_fault;
    ::usleep(1'000'000);  // the kernel cleans up after earlier processes
    before = device.status();
    device.begin_to_measure();
  }
  /// Prints the row of the table and returns the largest.
  static nanoseconds report(const char* what, const char* asked, std::vector<nanoseconds> all) {
    if (all.empty()) return {};
    std::sort(all.begin(), all.end());
    print_figure(fmt::format("encoders, SYNC by the {}, {}: {}",
                             GetParam().sync == SyncSource::Kernel ? "kernel" : "thread",
                             GetParam().busy ? "busy" : "idle", what),
                 asked, "n {}, median {:.0f} us, p99.9 {:.0f} us, max {:.0f} us", all.size(),
                 us(all[all.size() / 2]), us(all[all.size() * 999 / 1000]), us(all.back()));
    return all.back();
  }

  VirtualCan vcan;
  SimulatedEncoders encoders{vcan, kAxes, kNodePriority};
  BusyWorld world{GetParam().busy};
  MeasuredDevice device{vcan, GetParam().sync};
  drivers::DeviceStatus before;  ///< when the measurement began
};

TEST_P(DeadlinesInVirtualTime, FiveAxesAtOneKilohertzLoseNothingAndAreInTime) {
  begin();
  ::usleep(static_cast<useconds_t>(run_time(5s) / 1us));
  const auto& seen = device.stop();
  std::size_t incomplete = 0;
  std::uint64_t lost = 0;
  std::vector<nanoseconds> jitter;
  std::vector<nanoseconds> time_error;

  for (std::size_t i = 0; i < seen.samples.size(); ++i) {
    const auto& s = seen.samples[i];
    incomplete += s.missing_mask != 0 ? 1 : 0;
    lost += s.head.lost_before;
    if (i == 0 || s.missing_mask != 0 || s.head.lost_before != 0) continue;
    jitter.push_back(std::chrono::abs(s.head.time - seen.samples[i - 1].head.time - kPeriod));
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      const double off_m =
          std::abs(s.position[axis] - encoders.reading_m(axis, s.head.time)) - 5e-9;
      time_error.push_back(
          nanoseconds{static_cast<std::int64_t>(std::max(off_m, 0.0) / kFeed_m_per_s * 1e9)});
    }
  }

  print_figure("5 axes + SYNC at 1 kHz on vcan", "0 lost, 0 incomplete",
               "{} samples, {} lost, {} incomplete", seen.samples.size(), lost, incomplete);

  // CAN_BCM counts each period from when it served the last: by some 8 us too long here.
  const auto slowest = GetParam().sync == SyncSource::Kernel ? kPeriod * 102 / 100 : kPeriod;
  EXPECT_GE(seen.samples.size() + 2, static_cast<std::size_t>(run_time(5s) / slowest));
  EXPECT_EQ(incomplete, 0u) << device.status().last_fault;
  EXPECT_EQ(lost, 0u);
  const bool kernel = GetParam().sync == SyncSource::Kernel;
  EXPECT_LT(report("SYNC period off", kernel ? "200 us" : "500 us", jitter),
            kernel ? kPeriod / 5 : kPeriod / 2);

  // All five axes carry the time of the SYNC, and the position of the machine at that time.
  EXPECT_LT(report("time of the sample off", "50 us", time_error), 50us);
  EXPECT_LT(report("data ready to sample in ring", "1 period, 1000 us", seen.ready_to_ring),
            kPeriod);
  EXPECT_EQ(device.status().gaps, before.gaps);
  EXPECT_EQ(device.status().dropped, 0u);
}

TEST_P(DeadlinesInVirtualTime, AMissingAxisIsMarkedWithinOnePeriod) {
  begin();
  encoders.inject({.kind = FaultKind::Mute, .duration_s = 0.3, .node = 3});
  ::usleep(500'000);
  const auto& seen = device.stop();
  ASSERT_GE(seen.sync_to_flag.size(), 200u);
  EXPECT_LT(report("SYNC to missing axis marked", "1 period, 1000 us", seen.sync_to_flag), kPeriod);
  for (const auto& s : seen.samples) EXPECT_TRUE(s.missing_mask == 0 || s.missing_mask == 0b100);
}

TEST_P(DeadlinesInVirtualTime, AnInterfaceThatWasDownStreamsAgainWithinASecond) {
  begin();
  vcan.down();
  ASSERT_TRUE(device.state_becomes("closed"));
  ::usleep(100'000);
  const drivers::MonotonicTime time;
  vcan.up();
  const auto up = time.now();
  ASSERT_TRUE(device.state_becomes("streaming"));
  const auto took = time.now() - up;
  print_figure("CAN interface up to streaming", "1 s", "{:.0f} ms", us(took) / 1000.0);
  EXPECT_LT(took, 1s);
}

INSTANTIATE_TEST_SUITE_P(
    Encoders, DeadlinesInVirtualTime,
    testing::Values(Case{SyncSource::Kernel, false}, Case{SyncSource::Kernel, true},
                    Case{SyncSource::Thread, false}, Case{SyncSource::Thread, true}),
    [](const auto& instance) {
      return std::string{instance.param.sync == SyncSource::Kernel ? "KernelSync" : "ThreadSync"} +
             (instance.param.busy ? "Busy" : "Idle");
    });

}  // namespace
}  // namespace abbe::tests
