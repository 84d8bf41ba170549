/// Touches with a measuring machine, one after the other, and what ends them.

#include <gmock/gmock.h>

#include <limits>
#include <optional>
#include <string>

#include "abbe/service/touch_service.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr TouchService::WallTime kFirstCycle{100s};

struct Machine final : SampleSource {
  void drain(Batch&) override {}
  std::vector<StreamHealth> health(protocol::HostTime) override { return {}; }
  void measure(std::span<const drivers::ProbePoint> points) override {
    asked.insert(asked.end(), points.begin(), points.end());
  }
  Result<std::array<double, 3>> machine_position() const override {
    if (!ready) return fail(ErrorCode::Refused, "measuring machine cmm is not ready: connecting");
    return std::array<double, 3>{0.0, 0.0, 1.0};
  }
  Result<std::uint64_t> stop_machine() override { return static_cast<std::uint64_t>(++stopped); }
  drivers::IppStop machine_stop() const override { return stop; }
  std::optional<std::string> release_awaited() const override {
    return stopped > 0 ? std::optional<std::string>{"stopped by request"} : std::nullopt;
  }
  std::optional<TipPlace> tip_place() const override { return TipPlace{{0.1, 0.2, 0.0075}, 100ms}; }
  bool ready = true;
  int stopped = 0;
  drivers::IppStop stop{1, drivers::IppStopOutcome::Stopped, "AbortE was answered"};
  std::vector<drivers::ProbePoint> asked;
};

const MotionVolume kVolume{
    {-1, -1, -1}, {1, 1, 1}, {"[axes.X] travel", "[axes.Y] travel", "[axes.Z] travel"}};

TouchJob two_touches(std::vector<drivers::ProbePoint> leave = {}) {
  TouchRequest one;
  one.way = {{.position_m = {0, 0, 1}, .touch = false}};
  one.point = {.position_m = {0, 0, 0.1}};
  TouchRequest two;
  two.point = {.position_m = {0, 0, 0.2}};
  return touch_job(kVolume, {one, two}, std::move(leave)).value();
}

Batch touched(double z_m) {
  protocol::ProbeTrigger t;
  t.latch = protocol::TouchLatch::Reported;
  t.axis_count = 3;
  t.position[2] = z_m;
  Batch batch;
  batch.touches.push_back(t);
  return batch;
}

Batch refused() {
  Batch batch = touched(std::numeric_limits<double>::quiet_NaN());
  batch.touches[0].touch_flags |= protocol::TouchFlag::NoPosition;
  return batch;
}

TEST(TouchService, RequestsOneTouchAndItsApproachPathAtATime) {
  Machine machine;
  TouchService service{machine, true};

  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_EQ(machine.asked.size(), 2u);
  EXPECT_FALSE(machine.asked[0].touch);
  EXPECT_TRUE(machine.asked[1].touch);
  service.cycle({}, 1, "", kFirstCycle);
  EXPECT_EQ(machine.asked.size(), 2u);
  service.cycle(touched(0.1), 1, "", kFirstCycle);
  EXPECT_EQ(machine.asked.size(), 3u);
  EXPECT_TRUE(service.status().running);
  service.cycle(touched(0.2), 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_TRUE(service.status().reason.empty());
  ASSERT_EQ(service.status().touches.size(), 2u);
  EXPECT_EQ(service.status().touches[1].position[2], 0.2);
}

TEST(TouchService, AJobHasALimit) {
  const std::vector<TouchRequest> touches(TouchJob::kMostTouches);
  EXPECT_TRUE(touch_job(kVolume, touches));
  EXPECT_THAT(touch_job(kVolume, std::vector<TouchRequest>(touches.size() + 1)).error().text,
              HasSubstr("exceed the limits of one request"));
  TouchRequest roundabout;
  roundabout.way.resize(TouchJob::kMostPlaces);
  EXPECT_EQ(touch_job(kVolume, {roundabout}).error().code, ErrorCode::Usage);
}

TEST(TouchService, EndsAtARefusedTouchWithTheMachinesMessage) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.cycle(refused(), 0, "", kFirstCycle);
  EXPECT_TRUE(service.status().running);  // the reason is given in the next cycle
  service.cycle({}, 0, "PtMeas was refused: 1006 Surface not found", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_THAT(service.status().reason, HasSubstr("touch 1 of 2 was refused"));
  EXPECT_THAT(service.status().reason, HasSubstr("1006"));
  EXPECT_EQ(machine.asked.size(), 2u);
}

TEST(TouchService, KeepsTheTouchesMadeBeforeTheConnectionWasLost) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.cycle(touched(0.1), 1, "", kFirstCycle);
  service.cycle({}, 0, "connection closed by the peer", kFirstCycle);
  EXPECT_THAT(service.status().reason, HasSubstr("touch 2 of 2 was not made: connection closed"));
  EXPECT_EQ(service.status().touches.size(), 1u);
}

TEST(TouchService, ATouchWithoutAResultIsReported) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_THAT(service.status().reason, HasSubstr("the machine reported nothing"));
}

TEST(TouchService, RefusesImpossibleJobs) {
  Machine machine;
  TouchService none{machine, false};
  EXPECT_THAT(none.start(two_touches()).error().text, HasSubstr("[cmm]"));
  TouchService service{machine, true};
  EXPECT_FALSE(touch_job(kVolume, {}));
  EXPECT_FALSE(service.cancel());
  ASSERT_TRUE(service.start(two_touches()));
  EXPECT_EQ(service.start(two_touches()).error().code, ErrorCode::Refused);
}

TEST(TouchService, StopsTheMotionWhenCancelledAndReportsThePositionOfTheTip) {
  Machine machine;
  TouchService service{machine, true};

  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_TRUE(service.cancel());
  EXPECT_EQ(machine.stopped, 1);
  EXPECT_TRUE(service.status().running);
  EXPECT_FALSE(service.start(two_touches()));  // the machine does not stand yet
  service.cycle(refused(), 1, "", kFirstCycle);
  EXPECT_TRUE(service.status().running);
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(service.status().reason,
            "cancelled; the machine is stopped: AbortE was answered; the tip was reported at X "
            "100.000, Y 200.000, Z 7.500 mm 0.1 s before; "
            "look at the "
            "machine, then `abbe machine release`");
  EXPECT_EQ(machine.asked.size(), 2u);
}

TEST(TouchService, ReportsAStopThatTheMachineDoesNotConfirm) {
  Machine machine;
  machine.stop = {1, drivers::IppStopOutcome::Pending, ""};
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_TRUE(service.cancel());
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_TRUE(service.status().running) << "the outcome of the stop is awaited";
  machine.stop = {1, drivers::IppStopOutcome::NotConfirmed, "no answer to AbortE in 3 s"};
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(service.status().stop.outcome, drivers::IppStopOutcome::NotConfirmed);
  EXPECT_THAT(service.status().reason,
              HasSubstr("the stop of the machine is not confirmed: no answer to AbortE in 3 s"));
}

TEST(TouchService, AnOutcomeOfAnEarlierStopIsNotTheOutcomeOfThisOne) {
  Machine machine;
  machine.stopped = 4;  // the next stop is number 5
  machine.stop = {4, drivers::IppStopOutcome::Stopped, "AbortE was answered"};
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_TRUE(service.cancel());
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_TRUE(service.status().running);
}

TEST(TouchService, KeepsTheTouchThatWasMadeBeforeTheMachineStopped) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_TRUE(service.cancel());
  service.cycle(touched(0.1), 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(service.status().touches.size(), 1u);
  EXPECT_EQ(machine.asked.size(), 2u);
}

TEST(TouchService, StopsTheMachineAlsoOnItsWayOut) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches({{.position_m = {0, 0, 0.5}, .touch = false}})));
  service.cycle(touched(0.1), 1, "", kFirstCycle);
  service.cycle(touched(0.2), 0, "", kFirstCycle);
  ASSERT_TRUE(service.cancel());
  EXPECT_EQ(machine.stopped, 1);
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_THAT(service.status().reason, HasSubstr("the tip was reported at"));
}

TEST(TouchService, EndsWhenNoClientRequestsTheStatusAnyMore) {
  Machine machine;
  TouchService service{machine, true};

  ASSERT_TRUE(service.start(two_touches()));
  service.cycle({}, 2, "", kFirstCycle);
  service.cycle({}, 1, "", kFirstCycle + 1900ms);
  (void)service.look();
  service.cycle({}, 1, "", kFirstCycle + 2100ms);
  service.cycle({}, 1, "", kFirstCycle + 4000ms);
  EXPECT_TRUE(service.status().reason.empty()) << service.status().reason;
  (void)service.status();  // the daemon's own call is no client request
  service.cycle({}, 1, "", kFirstCycle + 4200ms);
  EXPECT_THAT(service.status().reason, HasSubstr("no client requested the touches"));
  EXPECT_TRUE(service.status().running);  // until the machine stands
  EXPECT_EQ(machine.stopped, 1);
  service.cycle({}, 1, "", kFirstCycle + 4300ms);
  EXPECT_EQ(machine.stopped, 1);
  service.cycle({}, 0, "", kFirstCycle + 4400ms);
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(machine.asked.size(), 2u);  // the second touch was never begun
}

TEST(TouchService, RestartsTheStatusTimeOutAtEveryStart) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.cycle({}, 0, "", kFirstCycle);
  ASSERT_FALSE(service.status().running);
  ASSERT_TRUE(service.start(two_touches()));
  service.cycle({}, 2, "", kFirstCycle + 1h);
  EXPECT_TRUE(service.status().reason.empty()) << service.status().reason;
}

TEST(TouchService, RetractsAfterTheLastTouchAndRunsUntilItHas) {
  Machine machine;
  TouchService service{machine, true};

  ASSERT_TRUE(service.start(two_touches({{.position_m = {0, 0, 0.5}, .touch = false}})));
  service.cycle(touched(0.1), 1, "", kFirstCycle);
  service.cycle(touched(0.2), 0, "", kFirstCycle);
  EXPECT_TRUE(service.status().running);
  ASSERT_EQ(machine.asked.size(), 4u);
  EXPECT_EQ(machine.asked[3].position_m[2], 0.5);
  EXPECT_FALSE(machine.asked[3].touch);
  service.cycle({}, 1, "", kFirstCycle);
  EXPECT_TRUE(service.status().running);
  service.cycle({}, 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_TRUE(service.status().reason.empty());
}

TEST(TouchService, DoesNotRetractAfterACancel) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches({{.position_m = {0, 0, 0.5}, .touch = false}})));
  ASSERT_TRUE(service.cancel());
  service.cycle(touched(0.1), 0, "", kFirstCycle);
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(machine.asked.size(), 2u);
}

TEST(TouchService, SendsNothingToAMachineThatIsNotReady) {
  Machine machine;
  machine.ready = false;
  TouchService service{machine, true};
  const auto started = service.start(two_touches());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::Refused);
  EXPECT_THAT(started.error().text, HasSubstr("not ready"));
  EXPECT_FALSE(service.where());
  EXPECT_TRUE(machine.asked.empty());
}

}  // namespace
}  // namespace abbe::daemon
