/// The state of the machine is stored by another thread: AbortE never waits for it, a motion always
/// does.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "ippdme_stage.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using drivers::IppDeviceOptions;
using drivers::IppMachine;
using testing::HasSubstr;

/// A store under the test's control.
struct Store {
  bool done = true;
  std::string fault;
  std::vector<IppMachine> kept;

  [[nodiscard]] IppDeviceOptions options() {
    IppDeviceOptions options;
    options.machine_changed = [this](const IppMachine& m) { kept.push_back(m); };
    options.machine_stored = [this] { return drivers::IppStored{.done = done, .fault = fault}; };
    return options;
  }
};

/// Ready; then a motion is requested while the store does not answer.
struct StoringStage : Store, IppStage {
  explicit StoringStage(const sim::IppDmeOptions& machine = machine_with_a_sphere())
      : IppStage(machine, options()) {
    EXPECT_TRUE(state_becomes("ready")) << last_fault();
    done = false;
    device->measure(on_top());
    EXPECT_TRUE(state_becomes("storing")) << state();
    cycles_for(2s);
  }
  /// No motion was sent, and none is sent later.
  void expect_nothing_was_sent() {
    done = true;
    cycles_for(10s);
    EXPECT_EQ(peer.machine().touches(), 0u);
    EXPECT_FALSE(peer.machine().moving());
    EXPECT_EQ(device->points_left(), 0u);
  }
};

TEST(IppStore, AbortIsSentWhileTheStoreDoesNotAnswer) {
  Store store;
  MovingStage stage{store.options()};
  store.done = false;
  stage.inject(sim::FaultKind::EmergencyStop);
  ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.times_heard("AbortE()") == 1; }));
  ASSERT_TRUE(stage.state_becomes(kHeld));
  EXPECT_THAT(store.kept.back().held, HasSubstr("0500 Emergency stop"));
  EXPECT_EQ(stage.device->status().condition, "") << "a healthy disk may need a moment";
  stage.cycles_for(2s);
  EXPECT_THAT(stage.device->status().condition, HasSubstr("not saved yet"));
  store.done = true;
  stage.cycles_for(100ms);
  EXPECT_EQ(stage.device->status().condition, "");
}

TEST(IppStore, AHoldThatCannotBeStoredIsNamedUntilItIs) {
  Store store;
  MovingStage stage{store.options()};
  store.done = false;
  store.fault = "write machine-hold: No space left on device";
  stage.device->abort();
  ASSERT_TRUE(stage.state_becomes(kHeld));
  EXPECT_EQ(stage.times_heard("AbortE()"), 1);
  EXPECT_THAT(stage.device->status().condition,
              testing::AllOf(HasSubstr("would not await a release"), HasSubstr("No space left")));
  store.done = true;
  stage.cycles_for(100ms);
  EXPECT_EQ(stage.device->status().condition, "");
}

TEST(IppStore, AMotionIsSentOnlyAfterItIsStored) {
  StoringStage stage;
  EXPECT_TRUE(stage.kept.back().moving);
  EXPECT_EQ(stage.device->points_left(), 1u);
  EXPECT_FALSE(stage.peer.machine().moving());
  stage.done = true;
  ASSERT_TRUE(stage.cycles_until(60s, [&] { return stage.touches.size() == 1; }))
      << stage.last_fault();
}

TEST(IppStore, AMotionThatCannotBeStoredIsNotSent) {
  StoringStage stage;
  stage.fault = "write machine-hold: Read-only file system";
  ASSERT_TRUE(stage.state_becomes("ready"));
  EXPECT_THAT(stage.last_fault(),
              testing::AllOf(HasSubstr("PtMeas was not sent"), HasSubstr("Read-only")));
  EXPECT_FALSE(stage.kept.back().moving);
  stage.expect_nothing_was_sent();
}

TEST(IppStore, AMotionThatIsNotStoredInTimeIsNotSent) {
  StoringStage stage;
  ASSERT_TRUE(stage.cycles_until(40s, [&] { return stage.state() == "ready"; }));
  EXPECT_THAT(stage.last_fault(), HasSubstr("is not stored after 30 s"));
  stage.expect_nothing_was_sent();
}

TEST(IppStore, HomingWaitsForTheStore) {
  Store store;
  store.done = false;
  auto options = store.options();
  options.session.home = true;
  IppStage stage{not_homed(), options};
  ASSERT_TRUE(stage.state_becomes("storing"));
  stage.cycles_for(5s);
  EXPECT_EQ(stage.times_heard("Home()"), 0);
  store.done = true;
  EXPECT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  EXPECT_EQ(stage.times_heard("Home()"), 1);
}

TEST(IppStore, AStopAnErrorOrALostConnectionDiscardsTheMotionThatWaits) {
  for (const int event : {0, 1, 2, 3}) {
    StoringStage stage;
    if (event == 0) stage.device->abort();
    if (event == 1) stage.peer.send("E0000 ! Error(3,0500,Machine,\"Emergency stop\")\r\n");
    if (event == 2) stage.peer.hang_up();
    if (event == 3) stage.device->end();
    ASSERT_TRUE(stage.cycles_until(1s, [&] { return stage.state() != "storing"; })) << event;
    EXPECT_EQ(stage.device->points_left(), 0u) << event;
    stage.expect_nothing_was_sent();
    EXPECT_EQ(stage.times_heard("AbortE()"), 0) << "nothing moved";
  }
}

TEST(IppPath, APathWithANumberThatCannotBeWrittenIsNotBegun) {
  IppStage stage;
  ASSERT_TRUE(stage.state_becomes("ready")) << stage.last_fault();
  const drivers::ProbePoint good{.position_m = {0.1, 0.2, 0.1}, .touch = false};
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e13}) {
    auto far = on_top();
    far.position_m[1] = bad;
    auto turned = on_top();
    turned.normal[2] = 1e3 * bad;
    for (const auto& point : {far, turned}) {
      stage.device->measure(std::array{good, point});
      stage.cycles_for(1s);
      EXPECT_THAT(stage.last_fault(),
                  testing::AllOf(HasSubstr("target 2 of 2"), HasSubstr("cannot be sent")));
    }
  }
  EXPECT_EQ(stage.peer.machine().heard().back().find("GoTo"), std::string::npos);
  EXPECT_EQ(stage.times_heard("GoTo(X(100),Y(200),Z(100))"), 0) << "nothing of it is sent";
  EXPECT_EQ(stage.device->points_left(), 0u);
  EXPECT_EQ(stage.state(), "ready");
}

}  // namespace
}  // namespace abbe::tests
