/// abbed is killed, or its hub hangs, while a measuring machine moves at its command.

#include <gmock/gmock.h>
#include <signal.h>

#include "hung_hub.hpp"
#include "moving_machine.hpp"

namespace abbe::test {
namespace {

using testing::HasSubstr;

bool moves_or_clears(const std::string& command) {
  return command.starts_with("GoTo") || command.starts_with("PtMeas") ||
         command.starts_with("Home") || command.starts_with("StartSession") ||
         command.starts_with("ClearAllErrors");
}

struct KilledWhileMoving : MovingMachine {
  /// Killed in `motion`, started again: the machine receives AbortE first, stops, and waits for
  /// a release.
  void expect_stopped_by_the_next_start(MachineInAThread& machine, const std::string& motion) {
    ASSERT_TRUE(machine.moving());
    abbed_->signal(SIGKILL);
    ASSERT_EQ(abbed_->wait_for_end(), -SIGKILL);
    const auto before = machine.heard().size();
    ASSERT_THAT(machine.heard().back(), testing::StartsWith(motion));
    ASSERT_TRUE(machine.moving()) << "nobody told it to stop";

    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_TRUE(eventually([&] { return machine.heard().size() > before; })) << abbed_->err();
    EXPECT_EQ(machine.heard()[before], "AbortE()");
    ASSERT_TRUE(eventually([&] { return stream("cmm")["state"] == "awaiting release"; }))
        << status().dump(1);
    EXPECT_FALSE(machine.moving());
    const Eigen::Vector3d stopped_m = machine.reading_m();
    EXPECT_FALSE(ask(touch_request())) << "nothing moves before a release";
    EXPECT_THAT(status()["release_awaited"]["reason"].get<std::string>(),
                HasSubstr("before the restart"));
    const auto heard = machine.heard();
    for (std::size_t i = before; i < heard.size(); ++i)
      EXPECT_FALSE(moves_or_clears(heard[i])) << heard[i];
    EXPECT_EQ(machine.reading_m(), stopped_m);

    const auto released = ask({{"do", "machine"}, {"release", true}});
    EXPECT_TRUE(released) << released.error().text;
    EXPECT_TRUE(eventually([&] { return machine.heard().back() != heard.back(); }));
  }
};

TEST_F(KilledWhileMoving, ATouchIsAbortedByTheNextStart) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_at(machine));
  ASSERT_NO_FATAL_FAILURE(begin_touch(machine));
  expect_stopped_by_the_next_start(machine, "PtMeas");
}

TEST_F(KilledWhileMoving, HomingIsAbortedByTheNextStart) {
  auto options = slow_machine();
  options.homed = false;
  MachineInAThread machine{options};
  ASSERT_NO_FATAL_FAILURE(start_at(machine, "home = true\n"));
  ASSERT_TRUE(
      eventually([&] { return machine.moving() && machine.heard().back().starts_with("Home"); }));
  expect_stopped_by_the_next_start(machine, "Home");
}

TEST_F(KilledWhileMoving, AHubThatHangsDoesNotKeepTheEndFromStoppingTheMachine) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_at(machine));
  ASSERT_NO_FATAL_FAILURE(begin_touch(machine));
  const pid_t hub = thread_of(abbed_->pid(), "abbe-hub");
  ASSERT_GT(hub, 0);
  if (!stop_thread(hub)) GTEST_SKIP() << "ptrace is not allowed here";

  abbed_->signal(SIGTERM);
  EXPECT_TRUE(eventually([&] { return !machine.moving(); }, std::chrono::seconds{3}))
      << "before exit code 70";
  keep_stopped_to_the_end(hub);
  EXPECT_EQ(abbed_->wait_for_end(), 70);
  EXPECT_THAT(machine.heard(), testing::Contains("AbortE()"));
}

}  // namespace
}  // namespace abbe::test
