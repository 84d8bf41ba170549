#include "abbe/drivers/sampling/touch_detector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simulated_scans.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::TouchDetector;
using drivers::TouchOptions;
using protocol::ProbeTrigger;
using protocol::SampleFlag;
using protocol::TouchFlag;
using protocol::TouchLatch;
using protocol::TouchScan;

/// As the simulated probe is, confirmed and armed again within its 6 ms.
TouchOptions options_for(const SimulatedProbe& probe) {
  TouchOptions o;
  o.delay.delay = SimulatedScans::ns(probe.delay_s);
  o.delay.u_jitter = SimulatedScans::ns(probe.jitter_s);
  o.approach.speed_window = 1ms;
  o.switching = {.confirm = 1ms, .chatter = 200us, .rearm_quiet = 1ms, .rearm_retract_m = 1e-6};
  o.wiring.clock_hz = probe.clock_hz;
  o.wiring.scan_period = SimulatedScans::ns(probe.scan_period_s);
  o.wiring.resolution.fill(probe.count_m);
  o.window_before = 1ms;
  o.window_after = 500us;
  return o;
}

/// Runs `touches` approaches; on_touch(trigger, scans) is called while the approach is still going
/// on.
template <class OnTouch>
void run(SimulatedScans& scans, TouchDetector& detector, std::uint32_t touches, OnTouch on_touch) {
  while (scans.touch() < touches) {
    detector.on_scan(scans.next());
    std::array<ProbeTrigger, 1> out;
    while (detector.touches().pop(out) == 1) on_touch(out[0]);
  }
}

std::vector<ProbeTrigger> touches_of(const SimulatedProbe& probe, const TouchOptions& options,
                                     std::uint32_t touches) {
  SimulatedScans scans{probe, 1};
  TouchDetector detector{options};
  std::vector<ProbeTrigger> out;
  run(scans, detector, touches, [&](const ProbeTrigger& t) { out.push_back(t); });
  return out;
}

/// Errors of 10,000 touches at 4 mm/s, along the approach, and how often an axis lies in its 95 %
/// interval.
struct Figure {
  std::size_t touches = 0;
  double max_m = 0.0;
  double rms_m = 0.0;
  double covered = 0.0;
};

Figure measured(const SimulatedProbe& probe, const TouchOptions& options, unsigned seed) {
  SimulatedScans scans{probe, seed};
  TouchDetector detector{options};
  Figure f;
  std::size_t intervals = 0;
  std::size_t held = 0;
  double sum = 0.0;

  run(scans, detector, 10'000, [&](const ProbeTrigger& t) {
    double error = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double e = t.position[i] - scans.contact_m(i);
      error += e * probe.direction[i];
      if (probe.direction[i] == 0.0) continue;
      ++intervals;
      held += std::abs(e) <= t.U95_position[i] ? 1 : 0;
    }
    ++f.touches;
    sum += error * error;
    f.max_m = std::max(f.max_m, std::abs(error));
  });

  f.rms_m = std::sqrt(sum / static_cast<double>(f.touches));
  f.covered = static_cast<double>(held) / static_cast<double>(intervals);
  ::testing::Test::RecordProperty("max_nm", std::to_string(1e9 * f.max_m));
  ::testing::Test::RecordProperty("rms_nm", std::to_string(1e9 * f.rms_m));
  ::testing::Test::RecordProperty("covered", std::to_string(f.covered));

  return f;
}

TEST(TouchDetectorFigure, LatchedByTheClockStaysWithin50Nanometres) {
  const SimulatedProbe probe;
  const Figure f = measured(probe, options_for(probe), 11);
  EXPECT_EQ(f.touches, 10'000u);
  EXPECT_LE(f.max_m, 0.05e-6);
  EXPECT_LE(f.rms_m, 0.01e-6);
  EXPECT_GE(f.covered, 0.93);
  EXPECT_LE(f.covered, 0.97);
}

TEST(TouchDetectorFigure, BetweenScansStaysWithin130Nanometres) {
  const SimulatedProbe probe{.latch_wired = false};
  const Figure f = measured(probe, options_for(probe), 12);
  EXPECT_EQ(f.touches, 10'000u);
  EXPECT_LE(f.max_m, 0.13e-6);
  EXPECT_GE(f.covered, 0.93);
  EXPECT_LE(f.covered, 0.97);
}

TEST(TouchDetectorFigure, ACoarseClockWidensTheStatedInterval) {
  const SimulatedProbe probe{.jitter_s = 0.2e-6, .clock_hz = 1e6, .count_m = 1e-9};
  const Figure f = measured(probe, options_for(probe), 13);
  EXPECT_GE(f.covered, 0.93);
  EXPECT_LE(f.covered,
            0.98);  // the clock's triangle is a little lighter in its tails than a normal
}

TEST(TouchDetector, SubtractsTheDelayOfARadioProbe) {
  const SimulatedProbe probe{.delay_s = 500e-6, .jitter_s = 0.0};
  SimulatedScans scans{probe, 2};
  TouchDetector detector{options_for(probe)};
  run(scans, detector, 20, [&](const ProbeTrigger& t) {
    // 20 nm: the counts of two axes, the clock; without the delay it would be 2 um.
    EXPECT_NEAR(t.position[0], scans.contact_m(0), 20e-9);
    EXPECT_NEAR(1e-9 * static_cast<double>((t.head.time.time_since_epoch() - 1h).count()),
                scans.contact_s(), 1e-6);
  });
  EXPECT_EQ(detector.counters().touches.value(), 20u);
}

TEST(TouchDetector, ReportsTheApproach) {
  const SimulatedProbe probe;
  for (const ProbeTrigger& t : touches_of(probe, options_for(probe), 5)) {
    EXPECT_NEAR(t.speed_m_s, 4e-3, 4e-5);
    EXPECT_NEAR(t.velocity[2], -0.8 * 4e-3, 4e-5);
    EXPECT_EQ(t.touch_flags, 0u);
    EXPECT_EQ(t.latch, TouchLatch::Clock);
  }
}

TEST(TouchDetector, FlagsASpeedThatTheProbeWasNotQualifiedFor) {
  const SimulatedProbe probe;
  TouchOptions options = options_for(probe);
  options.approach.max_speed_m_s = 3e-3;
  for (const auto& t : touches_of(probe, options, 3))
    EXPECT_EQ(t.touch_flags, 0u | TouchFlag::SpeedTooHigh);
  options.approach = {.min_speed_m_s = 5e-3, .max_speed_m_s = 1.0, .speed_window = 1ms};
  for (const auto& t : touches_of(probe, options, 3))
    EXPECT_EQ(t.touch_flags, 0u | TouchFlag::SpeedTooLow);
}

TEST(TouchDetector, FlagsAnApproachThatIsNotSteady) {
  const SimulatedProbe probe;
  TouchOptions options = options_for(probe);
  options.approach.speed_window = 5ms;  // reaches back into the retract before
  for (const auto& t : touches_of(probe, options, 3))
    EXPECT_TRUE(has(t.touch_flags, TouchFlag::SpeedUnsteady));
}

TEST(TouchDetector, KeepsTheFirstOfChatteringEdges) {
  const SimulatedProbe probe{.chatter_s = {40e-6, 110e-6}};
  SimulatedScans scans{probe, 3};
  TouchDetector detector{options_for(probe)};
  run(scans, detector, 10, [&](const ProbeTrigger& t) {
    EXPECT_TRUE(has(t.touch_flags, TouchFlag::Chattered));
    EXPECT_NEAR(t.position[2], scans.contact_m(2), 50e-9);
  });
  EXPECT_EQ(detector.counters().touches.value(), 10u);
}

TEST(TouchDetector, WidensTheIntervalWhenTheFirstEdgeWasOverwritten) {
  const SimulatedProbe probe{.chatter_s = {3e-6}};  // both within one scan, mostly
  SimulatedScans scans{probe, 4};
  TouchDetector detector{options_for(probe)};
  std::size_t widened = 0;
  double widest = 0.0;

  run(scans, detector, 20, [&](const ProbeTrigger& t) {
    if (t.latch == TouchLatch::Clock) return;
    ++widened;
    // Of a rectangle, 95 % are nearly all.
    EXPECT_NEAR(t.position[2], scans.contact_m(2), 1.5 * t.U95_position[2]);
    widest = std::max(widest, t.U95_position[2]);
  });

  EXPECT_GT(widened, 10u);
  EXPECT_GT(widest, 2e-8);  // of a latched touch: 1e-8
}

TEST(TouchDetector, DismissesVibrationBeforeATouch) {
  const SimulatedProbe probe{.chatter_s = {700e-6}};  // beyond chatter, before the confirmation
  const auto touches = touches_of(probe, options_for(probe), 5);
  ASSERT_EQ(touches.size(), 5u);
  EXPECT_FALSE(has(touches[0].touch_flags, TouchFlag::Chattered));
  SimulatedScans scans{probe, 1};
  TouchDetector detector{options_for(probe)};
  run(scans, detector, 5, [&](const ProbeTrigger& t) {
    EXPECT_NEAR(t.position[2] - scans.contact_m(2), -0.8 * 4e-3 * 700e-6, 50e-9);  // the later edge
  });
  EXPECT_EQ(detector.counters().dismissed.value(), 5u);
}

TEST(TouchDetector, DoesNotTreatAReleaseEdgeAsATouch) {
  const SimulatedProbe probe{.chatter_s = {2.5e-3}};  // while retracting
  TouchOptions options = options_for(probe);
  EXPECT_EQ(touches_of(probe, options, 8).size(), 8u);
}

TEST(TouchDetector, FallsBackToTheScansWhenTheLatchContradictsThem) {
  const SimulatedProbe probe{.latch_wrong_by = 10'000};
  const auto touches = touches_of(probe, options_for(probe), 3);
  ASSERT_EQ(touches.size(), 3u);
  EXPECT_EQ(touches[1].latch, TouchLatch::Scan);
  EXPECT_TRUE(has(touches[1].touch_flags, TouchFlag::LatchRefused));
}

TEST(TouchDetector, KeepsTheScansAroundEveryTouch) {
  const SimulatedProbe probe;
  SimulatedScans scans{probe, 5};
  TouchDetector detector{options_for(probe)};
  std::vector<TouchScan> window;

  while (scans.touch() < 3) {
    detector.on_scan(scans.next());
    std::array<TouchScan, 8> out;
    const std::size_t n = detector.windows().pop(out);
    for (std::size_t i = 0; i < n; ++i)
      if (out[i].touch == 2) window.push_back(out[i]);
  }

  ASSERT_NEAR(static_cast<double>(window.size()), 1.5e-3 * 33'333.0, 2.0);
  for (std::size_t i = 1; i < window.size(); ++i)
    EXPECT_LT(window[i - 1].clock_count, window[i].clock_count);
  EXPECT_LT(window.front().edge_count, window.back().edge_count);
}

TEST(TouchDetector, ReportsThatThereIsNoPositionWhereScansWereLost) {
  const SimulatedProbe probe{.jitter_s = 0.0};
  SimulatedScans scans{probe, 6};
  TouchDetector detector{options_for(probe)};
  std::vector<ProbeTrigger> out;

  while (scans.touch() < 2) {
    const auto scan = scans.next();
    if (std::abs(scans.now_s() - scans.contact_s()) < 200e-6 && scans.touch() == 0)
      continue;  // lost
    detector.on_scan(scan);
    std::array<ProbeTrigger, 1> one;
    if (detector.touches().pop(one) == 1) out.push_back(one[0]);
  }

  ASSERT_EQ(out.size(), 2u);
  EXPECT_TRUE(has(out[0].touch_flags, TouchFlag::NoPosition));
  EXPECT_TRUE(has(out[0].head.flags, SampleFlag::AxisMissing));
  EXPECT_EQ(out[1].touch_flags, 0u);
}

TEST(TouchDetector, MarksTheFirstTouchAfterARestartOfTheCard) {
  const SimulatedProbe probe;
  SimulatedScans scans{probe, 7};
  TouchDetector detector{options_for(probe)};
  std::vector<ProbeTrigger> out;
  bool restarted = false;

  while (scans.touch() < 4) {
    auto scan = scans.next();
    if (scans.touch() == 2 && !std::exchange(restarted, true))
      scan.axes.head.flags |= SampleFlag::Restarted;
    detector.on_scan(scan);
    std::array<ProbeTrigger, 1> one;
    if (detector.touches().pop(one) == 1) out.push_back(one[0]);
  }

  ASSERT_EQ(out.size(), 4u);
  EXPECT_FALSE(has(out[1].head.flags, SampleFlag::Restarted));
  EXPECT_TRUE(has(out[2].head.flags, SampleFlag::Restarted));
  EXPECT_FALSE(has(out[3].head.flags, SampleFlag::Restarted));
}

/// A counter that is debounced counts late; the latch shows the edge at once.
TEST(TouchDetector, UsesTheLatchedFirstEdgeOfADebouncedCounter) {
  const SimulatedProbe probe{.jitter_s = 0.0};
  TouchOptions options = options_for(probe);
  options.wiring.counter_debounce = 700us;
  SimulatedScans scans{probe, 8};
  TouchDetector detector{options};
  std::vector<drivers::CounterScan> late;  // the counter as it was 700 us ago
  std::size_t touches = 0;

  while (scans.touch() < 5) {
    auto scan = scans.next();
    late.push_back(scan);
    const auto counted = std::find_if(
        late.rbegin(), late.rend(),
        [&](const drivers::CounterScan& s) { return scan.clock_count - s.clock_count >= 7'000; });
    scan.edge_count = counted == late.rend() ? 0 : counted->edge_count;
    detector.on_scan(scan);
    std::array<ProbeTrigger, 1> one;
    if (detector.touches().pop(one) == 0) continue;
    ++touches;
    EXPECT_EQ(one[0].latch, TouchLatch::Clock);
    EXPECT_NEAR(one[0].position[2], scans.contact_m(2), 20e-9);
  }

  EXPECT_EQ(touches, 5u);
}

TEST(TouchOptionsCheck, NamesTheProbeAndTheFault) {
  TouchOptions options;
  EXPECT_TRUE(drivers::check(options));
  options.delay.id = 7;
  options.wiring.clock_hz = 0.0;
  const auto refused = drivers::check(options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text.find("probe 7"), std::string::npos);
  EXPECT_NE(refused.error().text.find("clock"), std::string::npos);
}

}  // namespace
}  // namespace abbe::tests
