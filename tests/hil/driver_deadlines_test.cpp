// Deadlines of the drivers behind TCP in virtual time, as deadlines_test.cpp has them for the
// encoders: from when the simulated device wrote its bytes until their samples are in the ring.
//
// ABBE_HIL_SECONDS: virtual seconds of each run (default 5).

#include <gtest/gtest.h>

#include "abbe/drivers/real_time_memory.hpp"
#include "busy_world.hpp"
#include "figure.hpp"
#include "run_time.hpp"
#include "simulated_devices.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using std::chrono::nanoseconds;

constexpr int kDevicePriority = 50;
constexpr int kPeerPriority = 90;  // hardware would take no processor time at all

/// The device thread's loop with a look at the clock after each cycle.
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
        came |= blocks[i].direction == protocol::RawBlock::Direction::FromDevice &&
                blocks[i].length != 0;
    }

    const auto n = driver_.pop();
    samples_ = samples_ + n;
    if (!came) return;

    // More bytes of one write may come in a later cycle: they are as old.
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
  void SetUp() override { ASSERT_TRUE(drivers::lock_memory().empty()); }

  void expect_samples_within_a_period(bool busy) {
    const BusyWorld world{busy};
    MeasuredDriver<Driver> driver;

    ASSERT_TRUE(driver.streams()) << driver.status().last_fault;
    ::usleep(500'000);  // the kernel cleans up after earlier processes
    const auto before = driver.status();
    driver.begin_to_measure();
    ::usleep(static_cast<useconds_t>(run_time(5s) / 1us));
    const auto after = driver.status();
    auto times = driver.stop();
    ASSERT_FALSE(times.empty());
    std::sort(times.begin(), times.end());
    print_figure(fmt::format("{}, {}: data written to samples in ring", Driver::kName,
                             busy ? "busy" : "idle"),
                 fmt::format("1 period, {:.0f} us", us(Driver::kPeriod)),
                 "n {}, median {:.0f} us, p99.9 {:.0f} us, max {:.0f} us, {} gaps", times.size(),
                 us(times[times.size() / 2]), us(times[times.size() * 999 / 1000]),
                 us(times.back()), after.gaps - before.gaps);
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
