// The program ends. The card continues to count, or does not. The next run of the program finds it.

#include <gmock/gmock.h>

#include "counter_card_peer.hpp"

namespace abbe::tests {
namespace {

using drivers::CounterCardProgress;
using protocol::SampleFlag;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// One run after another on one card.
class CardThatStays : public ::testing::Test {
 protected:
  CardThatStays() { run(slow_options()); }

  /// Few scans: it takes 7 s until a clock model is settled.
  static drivers::CounterCardOptions slow_options() {
    auto options = CardBench::default_options();
    options.receiver.wiring.scan_rate_hz = 2e3;
    options.transfer_time = 4ms;
    return options;
  }
  void cycles_for(std::chrono::nanoseconds duration) {
    constexpr auto kCycle = 2ms;
    for (const auto end = bench_.time.now() + duration; bench_.time.now() < end;) {
      bench_.server.poll(bench_.time.now());
      bench_.device->wait(kCycle);
      bench_.device->receive();
      bench_.time.advance(kCycle);
    }
  }

  void run(drivers::CounterCardOptions options) {
    bench_.device.reset();
    bench_.keeper.scans.clear();
    auto link = std::make_unique<drivers::UsbipLink>(
        drivers::UsbipOptions{.port = bench_.server.port(),
                              .identity = drivers::identity_of(options)},
        bench_.time);
    auto made =
        drivers::CounterCardDevice::create(options, std::move(link), bench_.time, &bench_.keeper);
    ASSERT_TRUE(made) << made.error().text;
    bench_.device = std::move(*made);
  }
  /// As a daemon that kept `from` and starts again.
  void run_on(const CounterCardProgress& from) {
    auto options = slow_options();
    options.receiver.resume_from = from;
    options.session.set_up_serial = std::string{from.serial_number()};
    run(options);
  }
  /// The latest of a run that streams until its clock model is settled.
  CounterCardProgress progress() {
    EXPECT_TRUE(bench_.streams());
    cycles_for(8s);
    CounterCardProgress latest;
    EXPECT_GT(bench_.device->progress().pop({&latest, 1}), 0u);
    while (bench_.device->progress().pop({&latest, 1}) != 0) {
    }
    return latest;
  }
  /// Time in which the card receives no request.
  void away(std::chrono::nanoseconds time) {
    bench_.device.reset();
    bench_.server.poll(bench_.time.now());
    bench_.time.advance(time);
  }
  std::vector<protocol::AxisSample> first_samples() {
    EXPECT_TRUE(bench_.streams()) << bench_.device->status().last_fault;
    return bench_.take_samples();
  }
  /// Where X stands in counts since the first run set it up.
  [[nodiscard]] static double counts_of_x(std::chrono::nanoseconds time) {
    return kSpeed_m_per_s * std::chrono::duration<double>(time).count() / kStep_m;
  }

  CardBench bench_;
};

TEST_F(CardThatStays, CountsContinueIfTheCardKeptCounting) {
  const auto before = progress();
  EXPECT_EQ(before.serial_number(), "01ABBE08");
  away(20s);
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  const auto& first = samples.front();
  EXPECT_FALSE(has(first.head.flags, SampleFlag::Restarted));
  EXPECT_TRUE(has(first.head.flags, SampleFlag::GapBefore));
  const double moved = counts_of_x(first.head.time - before.head.time);

  // Two clock models, each with 1 ms of unknown constant delay.
  EXPECT_NEAR(static_cast<double>(first.count[0] - before.count[0]), moved, counts_of_x(2ms));
  EXPECT_EQ(bench_.device->receiver().counters().restarted, 0u);
  EXPECT_GT(bench_.device->receiver().counters().withheld_scans, 0u);
}

TEST_F(CardThatStays, CountsContinueOverAWrapOfTheClock) {
  const auto before = progress();
  away(4300s);  // 2^32 at 1 MHz are 4295 s
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  EXPECT_FALSE(has(samples.front().head.flags, SampleFlag::Restarted));
  EXPECT_GT(bench_.keeper.scans.front().clock_count, std::int64_t{1} << 32);
}

TEST_F(CardThatStays, ACardThatLostPowerRestarts) {
  const auto before = progress();
  away(1s);
  bench_.server.card().restart();
  bench_.time.advance(1s);
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  EXPECT_TRUE(has(samples.front().head.flags, SampleFlag::Restarted));
  EXPECT_THAT(bench_.device->status().last_fault, HasSubstr("did not continue"));
}

// Its clock runs like before, from another zero: not one scan of it may look like the counters of
// before.
TEST_F(CardThatStays, ACardThatAnotherProgramSetUpRestarts) {
  const auto before = progress();
  away(500ms);
  run(slow_options());
  ASSERT_TRUE(bench_.streams());
  away(500ms);
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  EXPECT_TRUE(has(samples.front().head.flags, SampleFlag::Restarted));
  EXPECT_THAT(bench_.device->status().last_fault, HasSubstr("s behind its expected count"));
}

TEST_F(CardThatStays, AnotherCardRestarts) {
  auto before = progress();
  before.set_serial_number("01C0FFEE");
  away(1s);
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  EXPECT_TRUE(has(samples.front().head.flags, SampleFlag::Restarted));
  EXPECT_THAT(bench_.device->status().last_fault, HasSubstr("its serial number is \"01ABBE08\""));
}

TEST_F(CardThatStays, AfterTooLongACardIsTreatedAsRestarted) {
  const auto before = progress();
  // 50 ms and 200 ppm of it, both ways, are more than 0.5 % of 4295 s
  away(std::chrono::hours{16});
  run_on(before);
  const auto samples = first_samples();
  ASSERT_THAT(samples, ::testing::Not(IsEmpty()));
  EXPECT_TRUE(has(samples.front().head.flags, SampleFlag::Restarted));
}

// A replay of the second run's bytes with the same kept state gives the same scans.
TEST_F(CardThatStays, TheBytesGiveTheSameScans) {
  const auto before = progress();
  away(20s);
  run_on(before);
  ASSERT_TRUE(bench_.streams());
  cycles_for(100ms);
  auto options = slow_options().receiver;
  options.resume_from = before;
  const auto replayed = std::make_unique<drivers::CounterCardReceiver>(options);
  std::vector<drivers::CounterScan> scans;
  std::array<protocol::RawBlock, 64> blocks{};
  while (const auto n = bench_.device->raw().pop(blocks))
    for (std::size_t i = 0; i < n; ++i)
      replayed->on_raw(blocks[i], [&](const drivers::CounterScan& s) { scans.push_back(s); });
  ASSERT_EQ(scans.size(), bench_.keeper.scans.size());
  ASSERT_FALSE(scans.empty());

  for (std::size_t i = 0; i < scans.size(); ++i) {
    ASSERT_EQ(scans[i].axes.head.time, bench_.keeper.scans[i].axes.head.time) << i;
    ASSERT_EQ(scans[i].axes.count, bench_.keeper.scans[i].axes.count) << i;
    ASSERT_EQ(scans[i].clock_count, bench_.keeper.scans[i].clock_count) << i;
  }
}

}  // namespace
}  // namespace abbe::tests
