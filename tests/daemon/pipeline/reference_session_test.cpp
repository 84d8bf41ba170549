#include "abbe/pipeline/reference_session.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using drivers::MarkCrossing;
using protocol::AxisSample;
using protocol::HostTime;
using ReferenceState = AxisReference::State;

constexpr double kPeriod_m = 20e-6;
constexpr double kCountsPerPeriod = 80.0;  // 0.25 um a count
constexpr auto kScan = 500us;
const drivers::DistanceCode kCode{.increment = 1000, .length = 25'000};

/// Every mark of the scale, in m.
std::vector<double> marks_m() {
  std::vector<double> marks;
  for (int k = 0; k < 25; ++k) {
    marks.push_back(kPeriod_m * k * 1000);
    marks.push_back(kPeriod_m * (k * 1000 + 500 + k + 1));
  }
  return marks;
}

/// Two cards that count one scale from different zeros and were switched on at different times.
struct TwoCards {
  std::int64_t live_zero = 123'457;
  std::int64_t latch_zero = -9'876;
  std::chrono::nanoseconds latch_late = 300us;  ///< error of the latching card's host time
  std::int64_t latched = 0;

  void drive(ReferenceSession& session, const std::function<double(double)>& place_m,
             double seconds) {
    const auto marks = marks_m();
    double before = place_m(0.0);
    for (double t = 0.0; t < seconds;
         t += 1e-9 * static_cast<double>(std::chrono::nanoseconds{kScan}.count())) {
      const double here = place_m(t);
      const HostTime now{100s + std::chrono::nanoseconds{std::llround(1e9 * t)}};
      AxisSample live;
      live.head.time = now;
      live.axis_count = 1;
      live.count[0] = std::llround(here / kPeriod_m * kCountsPerPeriod) - live_zero;
      session.take(live);
      for (const double mark : marks) {
        if ((before < mark) == (here < mark)) continue;
        latched = std::llround(mark / kPeriod_m * kCountsPerPeriod) - latch_zero;
        session.take(
            MarkCrossing{{.time = now + latch_late}, now + latch_late - kScan, 0, latched});
      }
      before = here;
    }
  }
};

ReferenceOptions options() {
  ReferenceOptions o;
  o.axes = {{.name = "X",
             .marks = {.code = kCode, .counts_per_period = kCountsPerPeriod},
             .period = kPeriod_m}};
  o.axes[0].max_half_width_counts = 10.0;  // 2.5 um
  return o;
}

TEST(ReferenceSession, FindsThePositionAtWhichTheLiveCounterStarted) {
  ReferenceSession session{options()};
  TwoCards cards;
  cards.drive(
      session, [](double t) { return 0.1 + 1e-3 * t; }, 45.0);
  ASSERT_EQ(session.axis(0).state, ReferenceState::Found) << session.axis(0).reason;
  const double truth = kPeriod_m / kCountsPerPeriod * static_cast<double>(cards.live_zero);
  EXPECT_NEAR(session.axis(0).offset, truth, 2.5e-6);
  EXPECT_NEAR(session.axis(0).offset, truth, 3.0 * session.axis(0).u_offset);
  EXPECT_TRUE(session.finished());
}

TEST(ReferenceSession, DrivenSlowlyAlignsTheCardsToACount) {
  ReferenceOptions o = options();
  o.axes[0].max_half_width_counts = 0.75;
  o.u_alignment = 400us;
  ReferenceSession session{o};
  TwoCards cards;
  cards.drive(
      session, [](double t) { return 0.1095 + 0.12e-3 * t; }, 260.0);
  ASSERT_EQ(session.axis(0).state, ReferenceState::Found) << session.axis(0).reason;
  EXPECT_NEAR(session.axis(0).offset,
              kPeriod_m / kCountsPerPeriod * static_cast<double>(cards.live_zero), 0.25e-6);
}

TEST(ReferenceSession, ReportsThatTheCardsMustBeAlignedBetter) {
  ReferenceOptions o = options();
  o.axes[0].max_half_width_counts = 0.1;
  ReferenceSession session{o};
  TwoCards cards;
  cards.drive(
      session, [](double t) { return 0.1 + 5e-3 * t; }, 10.0);
  EXPECT_EQ(session.axis(0).state, ReferenceState::Searching);
  EXPECT_NE(session.axis(0).reason.find("slowly"), std::string::npos) << session.axis(0).reason;
}

TEST(ReferenceSession, AReversalBetweenMarksDiscardsTheMarksBefore) {
  ReferenceSession session{options()};
  TwoCards cards;
  // Two marks up, back over them, two up again: never four of one direction.
  cards.drive(
      session, [](double t) { return 0.1355 + 0.012 * std::sin(2.0 * t); }, 10.0);
  EXPECT_EQ(session.axis(0).state, ReferenceState::Searching);
  EXPECT_GT(session.axis(0).marks, 8u);
}

TEST(ReferenceSession, NamesACardThatMiscounts) {
  ReferenceSession session{options()};
  TwoCards cards;
  cards.drive(
      session, [](double t) { return 0.1 + 1e-3 * t; }, 15.0);
  cards.latch_zero += 400;  // five periods were lost; the axis stands on a mark
  const std::int64_t count = std::llround(0.13 / kPeriod_m * kCountsPerPeriod);
  HostTime now{120s};

  for (int i = 0; i < 20; ++i) {
    AxisSample live;
    live.head.time = now += kScan;
    live.axis_count = 1;
    live.count[0] = count - cards.live_zero;
    session.take(live);
    if (i == 5) session.take(MarkCrossing{{.time = now}, now - kScan, 0, count - cards.latch_zero});
  }

  EXPECT_EQ(session.axis(0).state, ReferenceState::Failed);
  EXPECT_NE(session.axis(0).reason.find("miscounts"), std::string::npos);
}

}  // namespace
}  // namespace abbe::daemon
