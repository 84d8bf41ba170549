/// Touches with a measuring machine, one after the other, and what ends them.

#include <gmock/gmock.h>

#include <limits>

#include "abbe/daemon/touch_service.hpp"

namespace abbe::daemon {
namespace {

using testing::HasSubstr;

struct Machine final : SampleSource {
  void drain(Batch&) override {}
  std::vector<StreamHealth> health(protocol::HostTime) override { return {}; }
  void measure(std::span<const drivers::ProbePoint> points) override {
    asked.insert(asked.end(), points.begin(), points.end());
  }
  std::vector<drivers::ProbePoint> asked;
};

std::vector<TouchRequest> two_touches() {
  TouchRequest one;
  one.way = {{.position_m = {0, 0, 1}, .touch = false}};
  one.point = {.position_m = {0, 0, 0.1}};
  TouchRequest two;
  two.point = {.position_m = {0, 0, 0.2}};
  return {one, two};
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

TEST(TouchService, AsksForOneTouchAndItsWayAtATime) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_EQ(machine.asked.size(), 2u);
  EXPECT_FALSE(machine.asked[0].touch);
  EXPECT_TRUE(machine.asked[1].touch);
  service.turn({}, 1, "");
  EXPECT_EQ(machine.asked.size(), 2u);
  service.turn(touched(0.1), 1, "");
  EXPECT_EQ(machine.asked.size(), 3u);
  EXPECT_TRUE(service.status().running);
  service.turn(touched(0.2), 0, "");
  EXPECT_FALSE(service.status().running);
  EXPECT_TRUE(service.status().reason.empty());
  ASSERT_EQ(service.status().touches.size(), 2u);
  EXPECT_EQ(service.status().touches[1].position[2], 0.2);
}

TEST(TouchService, EndsAtARefusedTouchWithWhatTheMachineSaid) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.turn(refused(), 0, "");
  EXPECT_TRUE(service.status().running);  // why was not asked for in that turn
  service.turn({}, 0, "PtMeas was refused: 1006 Surface not found");
  EXPECT_FALSE(service.status().running);
  EXPECT_THAT(service.status().reason, HasSubstr("touch 1 of 2 was refused"));
  EXPECT_THAT(service.status().reason, HasSubstr("1006"));
  EXPECT_EQ(machine.asked.size(), 2u);
}

TEST(TouchService, KeepsTheTouchesUntilTheMachineWentAway) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.turn(touched(0.1), 1, "");
  service.turn({}, 0, "connection closed by the peer");
  EXPECT_THAT(service.status().reason, HasSubstr("touch 2 of 2 was not made: connection closed"));
  EXPECT_EQ(service.status().touches.size(), 1u);
}

TEST(TouchService, ATouchThatReportsNothingIsSaidToHaveReportedNothing) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  service.turn({}, 0, "");
  EXPECT_THAT(service.status().reason, HasSubstr("the machine reported nothing"));
}

TEST(TouchService, RefusesWhatCannotBe) {
  Machine machine;
  TouchService none{machine, false};
  EXPECT_THAT(none.start(two_touches()).error().text, HasSubstr("[cmm]"));
  TouchService service{machine, true};
  EXPECT_FALSE(service.start({}));
  EXPECT_FALSE(service.cancel());
  ASSERT_TRUE(service.start(two_touches()));
  EXPECT_EQ(service.start(two_touches()).error().code, ErrorCode::Refused);
}

TEST(TouchService, MakesAndKeepsTheTouchThatIsUnderWayWhenCancelled) {
  Machine machine;
  TouchService service{machine, true};
  ASSERT_TRUE(service.start(two_touches()));
  ASSERT_TRUE(service.cancel());
  EXPECT_TRUE(service.status().running);
  EXPECT_FALSE(service.start(two_touches()));  // that touch would count as its first one
  service.turn(touched(0.1), 1, "");
  EXPECT_FALSE(service.status().running);
  EXPECT_EQ(service.status().reason, "cancelled");
  EXPECT_EQ(service.status().touches.size(), 1u);
  EXPECT_EQ(machine.asked.size(), 2u);
}

}  // namespace
}  // namespace abbe::daemon
