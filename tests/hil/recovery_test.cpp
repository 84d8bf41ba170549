// How soon each driver shows that its device misbehaves, and how soon it streams again when the
// device is well: every fault the simulated devices know, in virtual time, against what is asked of
// it.

#include <gtest/gtest.h>

#include "abbe/drivers/real_time_memory.hpp"
#include "figure.hpp"
#include "simulated_devices.hpp"

namespace abbe::tests {
namespace {

using protocol::HostTime;
using protocol::SampleFlag;
using sim::FaultKind;
using sim::FaultTarget;

constexpr double kAt_s = 4.0;  // by then all stream
constexpr nanoseconds kAgain = 1s;
constexpr nanoseconds kJustBefore = 2ms;

struct Row {
  const char* name;
  FaultKind kind;
  nanoseconds visible;  ///< asked
  double duration_s = 0.5;
  double value = 0.0;
  /// What the device itself takes from its end on: warm-up, Initialize, the first burst.
  nanoseconds start_up{};
};

double ms(nanoseconds t) {
  return std::chrono::duration<double, std::milli>(t).count();
}

template <class Driver>
class Recovery {
 public:
  Recovery(FaultTarget target, const Row& row)
      : row_(row),
        driver_({{target,
                  {.kind = row.kind,
                   .at_s = kAt_s,
                   .duration_s = row.duration_s,
                   .value = row.value}}}),
        begin_(*driver_.simulation->machine().started() + sim::seconds_to_ns(kAt_s)),
        end_(begin_ + sim::seconds_to_ns(row.duration_s)) {}

  void measure() {
    drivers::DeviceStatus before;
    // On a busy computer one cycle may outlast the time just before the fault.
    (void)cycles_until(begin_ - kJustBefore, [&] {
      if (monotonic().now() < begin_) before = driver_.device->status();
      return false;
    });

    ASSERT_TRUE(usable_since(HostTime{})) << driver_.device->status().last_fault;
    std::erase_if(heads_, [this](const auto& head) { return head.time < begin_ - kJustBefore; });
    ASSERT_TRUE(cycles_until(begin_ + 10s, [&] { return shows(before); })) << "never visible";
    const auto visible = std::max(seen_at_, begin_) - begin_;
    const auto well = end_ + row_.start_up;
    ASSERT_TRUE(cycles_until(well + 30s, [&] { return usable_since(end_); }))
        << "never again; " << driver_.device->status().last_fault;
    const auto again = std::max(monotonic().now(), well) - well;
    print_figure(fmt::format("recovery, {}, {}", Driver::kName, row_.name),
                 fmt::format("visible {:.0f} ms, again {:.0f} ms", ms(row_.visible), ms(kAgain)),
                 "visible after {:.1f} ms, data again {:.1f} ms after the device is well",
                 ms(visible), ms(again));
    EXPECT_LE(visible, row_.visible) << row_.name;
    EXPECT_LE(again, kAgain) << row_.name;
  }

 private:
  template <class Done>
  bool cycles_until(HostTime limit, Done done) {
    while (!done()) {
      if (monotonic().now() > limit) return false;
      driver_.device->wait(1ms);
      driver_.device->receive();
      driver_.pop(&heads_);
      std::array<protocol::RawBlock, 64> blocks;  // NOLINT: filled by pop
      while (driver_.device->raw().pop(blocks) == blocks.size()) {
      }
    }
    return true;
  }
  static bool usable(const protocol::SampleHead& head) {
    constexpr auto kNot = SampleFlag::AxisMissing | SampleFlag::BusOff | SampleFlag::DeviceError |
                          SampleFlag::SpeedExceeded | SampleFlag::PointInvalid;
    return (head.flags & kNot) == 0;
  }
  bool usable_since(HostTime since) {
    return std::any_of(heads_.begin(), heads_.end(),
                       [&](const auto& head) { return usable(head) && head.time >= since; });
  }
  /// In the status or on a sample.
  bool shows(const drivers::DeviceStatus& before) {
    const auto now = driver_.device->status();
    const bool status = now.faults != before.faults || now.gaps != before.gaps ||
                        now.connected != before.connected || now.state != before.state;
    const bool sample =
        std::any_of(heads_.begin(), heads_.end(), [](const auto& head) { return !usable(head); });
    seen_at_ = monotonic().now();
    return status || sample;
  }

  Row row_;
  Driver driver_;
  ServedDevices peer_{driver_.peer(), 90};
  HostTime begin_;
  HostTime end_;
  HostTime seen_at_{};
  Heads heads_;
};

template <class Driver>
void measure_all(FaultTarget target, const std::vector<Row>& rows) {
  ASSERT_TRUE(drivers::lock_memory().empty());
  for (const auto& row : rows) {
    SCOPED_TRACE(row.name);
    Recovery<Driver>{target, row}.measure();
  }
}

TEST(Recovery, OfEncoders) {
  measure_all<Encoders>(FaultTarget::Encoder,
                        {{"mute", FaultKind::Mute, 2ms},
                         {"bus-off", FaultKind::BusOff, 100ms},
                         {"emergency", FaultKind::Emergency, 100ms, 0.5, 0x5000},
                         {"garbage", FaultKind::BusGarbage, 100ms, 0.0},
                         {"restart", FaultKind::Restart, 2ms, 0.02}});
}

TEST(Recovery, OfTheCounterCard) {
  measure_all<CounterCard>(FaultTarget::CounterCard,
                           {{"mute", FaultKind::Mute, 100ms},
                            {"unplugged", FaultKind::Unplug, 100ms},
                            {"power off and on", FaultKind::CardRestart, 100ms, 0.0},
                            {"overrun", FaultKind::Overrun, 100ms, 0.0},
                            {"lost scans", FaultKind::LostScans, 100ms, 0.0, 100},
                            {"clock jump", FaultKind::ClockJump, 100ms, 0.0, 2'000'000},
                            {"garbage", FaultKind::UsbGarbage, 100ms, 0.0}});
}

TEST(Recovery, OfTheTracker) {
  constexpr auto kBurst = 350ms;
  constexpr auto kSetUp = kBurst + 100ms;  // Initialize takes this simulated one 100 ms
  measure_all<Tracker>(FaultTarget::Tracker,
                       {{"mute", FaultKind::Mute, 1500ms, 2.0, 0.0, kSetUp},
                        {"beam broken", FaultKind::BeamBreak, 100ms, 1.0, 0.0, kBurst},
                        {"connection broken", FaultKind::Disconnect, 100ms, 0.0, 0.0, kSetUp},
                        {"power off and on", FaultKind::Reboot, 100ms, 2.0, 0.0, kSetUp},
                        {"garbage", FaultKind::TrackerGarbage, 100ms, 0.0, 0.0, kSetUp}});
}

TEST(Recovery, OfTheEnvironment) {
  measure_all<Environment>(FaultTarget::Environment,
                           {{"mute", FaultKind::Mute, 600ms, 1.0},
                            {"connection broken", FaultKind::Disconnect, 100ms},
                            {"exception", FaultKind::ModbusException, 200ms, 0.5, 6},
                            {"garbage", FaultKind::ModbusGarbage, 200ms}});
}

TEST(Recovery, OfTheEnvironmentOnASerialLine) {
  measure_all<SerialEnvironment>(FaultTarget::Environment,
                                 {{"mute", FaultKind::Mute, 600ms, 1.0},
                                  {"plugged out and in", FaultKind::Disconnect, 100ms},
                                  {"exception", FaultKind::ModbusException, 200ms, 0.5, 6},
                                  {"garbage", FaultKind::ModbusGarbage, 200ms}});
}

}  // namespace
}  // namespace abbe::tests
