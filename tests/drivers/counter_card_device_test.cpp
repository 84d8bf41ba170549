// The counter card driver against the simulated card, over a real USB/IP connection in stepped
// time.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "abbe/drivers/usb/libusb_link.hpp"
#include "abbe/sim/counter_card_setup.hpp"
#include "counter_card_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using protocol::SampleFlag;
using testing::HasSubstr;

TEST(CounterCardDevice, ReadsPositionsOfTheMovingAxis) {
  CardBench bench;
  ASSERT_TRUE(bench.streams()) << bench.device->status().last_fault;
  bench.take_samples();
  bench.cycles_for(100ms);
  const auto samples = bench.take_samples();
  ASSERT_GT(samples.size(), 3000u);
  const auto& first = samples.front();
  const auto& last = samples.back();
  const double seconds = std::chrono::duration<double>(last.head.time - first.head.time).count();

  // A young clock model may still change its slope by 1 %.
  EXPECT_NEAR((last.position[0] - first.position[0]) / seconds, kSpeed_m_per_s, 2e-4);
  EXPECT_EQ(last.position[1], 0.0);
  EXPECT_EQ(last.axis_count, 2);
}

TEST(CounterCardDevice, LosesNothing) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(500ms);
  const auto samples = bench.take_samples();
  for (std::size_t i = 1; i < samples.size(); ++i)
    ASSERT_EQ(samples[i].cycle, samples[i - 1].cycle + 1);
  EXPECT_EQ(bench.device->status().gaps, 0u);
  EXPECT_EQ(bench.device->status().faults, 0u);
  EXPECT_EQ(bench.device->status().state, "streaming");
}

TEST(CounterCardDevice, StampsAScanWithTheInstantItDescribes) {
  CardBench bench;
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(9s);
  const auto& scans = bench.keeper.scans;
  const auto& begin = scans.front();
  bench.take_samples();
  bench.cycles_for(10ms);
  const auto last = bench.take_samples().back();
  ASSERT_TRUE(bench.device->status().clock.settled);
  EXPECT_LT(last.head.u_time, 1ms);
  EXPECT_LE(last.head.time, bench.time.now());
  EXPECT_GT(last.head.time, bench.time.now() - 3ms);

  // By the truth of the axis: x = speed x (t - when it was set up); the first scan came one scan
  // later.
  const double by_axis_s = (last.position[0] - begin.axes.position[0]) / kSpeed_m_per_s;
  EXPECT_NEAR(std::chrono::duration<double>(last.head.time - begin.axes.head.time).count(),
              by_axis_s, 2e-3);
}

TEST(CounterCardDevice, ReadsLinearAndRotaryAxesInBothWidths) {
  for (const auto width :
       {drivers::quad08::CountWidth::Bits32, drivers::quad08::CountWidth::Bits48}) {
    auto options = CardBench::default_options();
    auto& wiring = options.receiver.wiring;
    wiring.width = width;
    wiring.scan_rate_hz = 10e3;
    wiring.axes = {
        {"X", 0, 1e-8}, {"Y", 1, 1e-8}, {"Z", 2, -1e-8}, {"A", 3, 1e-6, 0.5}, {"C", 4, 1e-6}};
    auto card = simulated_card();
    const auto constant = [&](std::size_t channel, double before, double after, double step) {
      card.channels[channel].phases = sim::ScaleSignal{
          .reading =
              [=](sim::HostTime t) { return t < sim::HostTime{1h} + 600ms ? before : after; },
          .step = step};
    };
    constant(0, 0.1, 0.2, 1e-8);
    constant(1, 0.1, 0.05, 1e-8);
    constant(2, 0.0, 0.03, -1e-8);
    constant(3, 0.0, 0.25, 1e-6);
    constant(4, 1.0, -1.0, 1e-6);
    CardBench bench{options, card};
    ASSERT_TRUE(bench.streams()) << bench.device->status().last_fault;
    bench.cycles_for(700ms);
    const auto position = bench.take_samples().back().position;
    EXPECT_NEAR(position[0], 0.1, 1e-8);
    EXPECT_NEAR(position[1], -0.05, 1e-8);
    EXPECT_NEAR(position[2], 0.03, 1e-8);
    EXPECT_NEAR(position[3], 0.75, 1e-6);
    EXPECT_NEAR(position[4], -2.0, 1e-6);
  }
}

TEST(CounterCardDevice, LatchesTheProbeToOneClockPeriodWithItsOwnTimer) {
  auto options = CardBench::default_options();
  options.receiver.wiring.clock_source = drivers::ClockSource::Timer0;
  auto card = simulated_card();
  card.channels[5].phases = sim::TimerSignal{};
  card.channels[6] = {sim::TimerSignal{}, true};
  CardBench bench{options, card};
  ASSERT_TRUE(bench.streams()) << bench.device->status().last_fault;

  for (int touch = 0; touch < 5; ++touch) {
    const auto edge = bench.time.now() + 3ms + touch * 17us;
    bench.server.card().add_probe_edge(edge);
    bench.cycles_for(10ms);
    const auto& scan = bench.keeper.scans.back();
    ASSERT_TRUE(scan.latched);
    EXPECT_EQ(scan.latch_half_width, 0);

    // Where X was at the edge, by interpolation at the latched count: 20 nm a clock period.
    const auto after = std::ranges::find_if(
        bench.keeper.scans, [&](const auto& s) { return s.clock_count >= scan.latch_count; });
    const double t = static_cast<double>(scan.latch_count - after->clock_count) / kClock_hz;
    const double x = after->axes.position[0] + t * kSpeed_m_per_s;
    const auto& begin = bench.keeper.scans.front();
    const double truth =
        kSpeed_m_per_s * std::chrono::duration<double>(edge - begin.axes.head.time).count();

    // The host time of the first scan has the error of the clock model; all touches share it.
    EXPECT_NEAR(x - begin.axes.position[0], truth, 1e-3 * kSpeed_m_per_s);
  }

  EXPECT_EQ(bench.device->receiver().counters().latch_disagreements, 0u);
}

TEST(CounterCardDevice, ReportsThatTheLatchIsAnAssumption) {
  CardBench bench;
  EXPECT_THAT(bench.device->assumption(), HasSubstr("not yet verified on hardware"));
}

TEST(CounterCardDevice, GivesTheCountAtTheIndexPulseAndNoLivePosition) {
  auto options = CardBench::default_options();
  options.receiver.wiring.axes = {
      {.name = "X", .channel = 0, .scale = kStep_m, .latch_on_index = true}};
  auto card = simulated_card();
  std::get<sim::ScaleSignal>(card.channels[0].phases).marks = {0.012, 0.016, 0.02};
  CardBench bench{options, card};
  ASSERT_TRUE(bench.until([&] { return bench.keeper.scans.size() > 1; }));
  const auto set_up_at = bench.keeper.scans.front().axes.head.time;
  bench.cycles_for(1s);
  EXPECT_TRUE(bench.take_samples().empty()) << "a card of marks has no axis samples";
  std::vector<std::int64_t> counts;

  for (const auto& scan : bench.keeper.scans) {
    if (counts.empty() || counts.back() != scan.axes.count[0]) counts.push_back(scan.axes.count[0]);
  }

  EXPECT_GT(set_up_at, sim::HostTime{1h});
  ASSERT_GE(counts.size(), 3u);
  for (std::size_t i = 2; i < counts.size(); ++i)
    EXPECT_EQ(counts[i] - counts[i - 1], 400'000);  // 4 mm
  EXPECT_EQ(bench.keeper.scans.back().index_latched_mask, 1);
}

TEST(CounterCardDevice, GivesOneSampleForSoManyScansWithoutLosingAMark) {
  auto options = CardBench::default_options();
  options.sample_every = 40;
  CardBench bench{options};
  ASSERT_TRUE(bench.streams());
  bench.cycles_for(20ms);
  bench.take_samples();
  bench.server.card().lose_scans(5);
  bench.cycles_for(100ms);
  const auto samples = bench.take_samples();
  EXPECT_NEAR(static_cast<double>(samples.size()), 100.0, 3.0);
  EXPECT_EQ(std::ranges::count_if(samples, [](const auto& s) { return s.head.lost_before == 5; }),
            1);
}

TEST(CounterCardDevice, ReplaysItsRawBytesToTheSameScans) {
  CardBench bench;
  drivers::CounterCardReceiver replayed{CardBench::default_options().receiver};
  std::vector<drivers::CounterScan> again;
  std::array<protocol::RawBlock, 64> blocks;

  for (int i = 0; i < 6000; ++i) {
    bench.cycle();
    if (i == 4000) bench.server.card().overrun();
    while (const auto n = bench.device->raw().pop(blocks))
      for (std::size_t b = 0; b < n; ++b)
        replayed.on_raw(blocks[b], [&](const drivers::CounterScan& s) { again.push_back(s); });
  }

  ASSERT_GT(again.size(), 10'000u);
  ASSERT_EQ(again.size(), bench.keeper.scans.size());
  for (std::size_t i = 0; i < again.size(); ++i) {
    const auto& live = bench.keeper.scans[i];
    ASSERT_EQ(again[i].axes.head.time, live.axes.head.time) << i;
    ASSERT_EQ(again[i].axes.head.flags, live.axes.head.flags) << i;
    ASSERT_EQ(again[i].clock_count, live.clock_count);
    ASSERT_EQ(again[i].axes.count, live.axes.count);
  }
}

TEST(CounterCardDevice, RefusesAnotherDeviceByName) {
  auto card = simulated_card();
  card.vendor = 0x1209;
  card.product = 0x0001;
  CardBench bench{CardBench::default_options(), card};
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault,
              HasSubstr("it is 1209:0001, configured is 09DB:00CA"));
  EXPECT_FALSE(bench.device->status().connected);
}

TEST(CounterCardDevice, RefusesAnotherSerialNumberByName) {
  auto options = CardBench::default_options();
  options.serial = "01C0FFEE";
  CardBench bench{options};
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault,
              HasSubstr("its serial number is \"01ABBE08\", configured is \"01C0FFEE\""));
}

TEST(CounterCardDevice, RefusesACardThatFailsItsSelfTest) {
  CardBench bench;
  bench.server.card().corrupt_register(0x00AA);
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("self-test: register 5Dh reads 00AAh"));
  const auto faults = bench.device->status().faults;
  bench.cycles_for(3s);
  EXPECT_EQ(bench.device->status().faults, faults) << "the same again is the same fault";
}

TEST(CounterCardDevice, RefusesAnOldFirmware) {
  auto card = simulated_card();
  card.firmware = 0x0042;
  CardBench bench{CardBench::default_options(), card};
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("firmware version"));
}

TEST(CounterCardDevice, ReportsThatTheClockStandsStill) {
  auto card = simulated_card();
  card.channels[5].phases = std::monostate{};
  CardBench bench{CardBench::default_options(), card};
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault,
              HasSubstr("clock channel 5 counted 0 in one scan, 25.0 expected"));
  EXPECT_EQ(bench.device->status().samples, 0u);
}

// In step with the pacer, to the two counts a reading may be off, but not with the host's clock.
TEST(CounterCardDevice, ReportsAClockThatRunsTooFast) {
  auto card = simulated_card();
  card.channels[5].phases = sim::ClockSignal{.hz = kClock_hz, .deviation_ppm = 2000.0};
  auto options = CardBench::default_options();
  options.receiver.wiring.latch_channel.reset();
  options.receiver.wiring.scan_rate_hz = 2e3;
  options.transfer_time = 4ms;
  CardBench bench{options, card};

  ASSERT_TRUE(bench.streams());
  bench.cycles_for(12s);
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr("the clock of channel 5 runs "));
  EXPECT_THAT(bench.device->status().last_fault, HasSubstr(" ppm fast, the limit is 200 ppm"));
  EXPECT_EQ(bench.device->status().faults, 1u);
  EXPECT_EQ(bench.device->status().state, "streaming");
  EXPECT_TRUE(has(bench.take_samples().back().head.flags, SampleFlag::ClockUnsettled));
}

TEST(CounterCardDevice, ReportsThatTheLatchCountsAnotherClock) {
  auto options = CardBench::default_options();
  options.receiver.wiring.clock_source = drivers::ClockSource::Timer0;
  auto card = simulated_card();
  // but the latch channel hangs on a clock of its own
  card.channels[5].phases = sim::TimerSignal{};
  CardBench bench{options, card};
  ASSERT_TRUE(bench.streams()) << bench.device->status().last_fault;
  bench.server.card().add_probe_edge(bench.time.now() + 2ms);
  EXPECT_TRUE(bench.until([&] { return bench.device->status().faults != 0; }));
  EXPECT_THAT(bench.device->status().last_fault,
              HasSubstr("latch channel 6 does not count the clock"));
}

TEST(CounterCardDevice, SearchesForACardWithLibusbAndReportsThatThereIsNone) {
  auto options = CardBench::default_options();
  options.serial = "no such card";
  SteppedTime time;
  auto link = std::make_unique<drivers::LibusbLink>(drivers::identity_of(options), time);
  auto device = drivers::CounterCardDevice::create(options, std::move(link), time);
  ASSERT_TRUE(device.has_value());

  for (int i = 0; i < 10; ++i) {
    (*device)->wait(1ms);
    (*device)->receive();
    time.advance(1ms);
  }

  EXPECT_EQ((*device)->status().faults, 1u);
  EXPECT_THAT((*device)->status().last_fault, HasSubstr("USB 09DB:00CA"));
  EXPECT_FALSE((*device)->status().connected);
}

TEST(CounterCardDevice, RefusesAnImpossibleWiring) {
  auto options = CardBench::default_options();
  options.receiver.wiring.axes[0].scale = 0.0;
  SteppedTime time;
  auto link = std::make_unique<drivers::UsbipLink>(drivers::UsbipOptions{}, time);
  const auto device = drivers::CounterCardDevice::create(options, std::move(link), time);
  ASSERT_FALSE(device.has_value());
  EXPECT_EQ(device.error().code, drivers::ErrorCode::BadConfiguration);
}

}  // namespace
}  // namespace abbe::tests
