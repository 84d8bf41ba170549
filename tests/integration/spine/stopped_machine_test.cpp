/// A stop of the measuring machine is answered with what is known: stopped, not confirmed, not
/// sent.

#include <gmock/gmock.h>
#include <signal.h>

#include <optional>

#include "moving_machine.hpp"

namespace abbe::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct StoppedMachine : MovingMachine {
  [[nodiscard]] Outcome stop() const {
    return run({ABBE_PROGRAM, "machine", "stop", "--socket", file("run/control.sock")});
  }
  [[nodiscard]] bool journal_has(const std::string& text) const {
    return eventually([&] { return abbed_->err().find(text) != std::string::npos; });
  }
};

TEST_F(StoppedMachine, AStopThatTheMachineConfirmsIsExitCode0) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_touching(machine));
  const Outcome stopped = stop();
  EXPECT_EQ(stopped.code, 0) << stopped.err;
  EXPECT_THAT(stopped.out, HasSubstr("stopped: AbortE was answered"));
  EXPECT_FALSE(machine.moving());
  EXPECT_EQ(status()["machine_stop"]["outcome"], "stopped");
  EXPECT_TRUE(journal_has("measuring machine: stopped: AbortE was answered"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
}

TEST_F(StoppedMachine, AStopThatTheMachineRefusesIsNotConfirmed) {
  auto options = slow_machine();
  options.refuses_aborts = true;
  MachineInAThread machine{options};
  ASSERT_NO_FATAL_FAILURE(start_touching(machine));
  const Outcome stopped = stop();
  EXPECT_EQ(stopped.code, 6) << stopped.out;
  EXPECT_THAT(stopped.err, AllOf(HasSubstr("not confirmed"), HasSubstr("AbortE was refused"),
                                 HasSubstr("emergency stop")));
  EXPECT_EQ(status()["machine_stop"]["outcome"], "not confirmed");
  EXPECT_TRUE(eventually([&] {
    return stream("cmm")["condition"].get<std::string>().starts_with("the machine may be moving");
  }));
  EXPECT_TRUE(journal_has("measuring machine: stop not confirmed: AbortE was refused"));
  EXPECT_TRUE(machine.moving());
  EXPECT_EQ(abbed_->stop(), 6) << "it ends, and the machine moves on";
  EXPECT_THAT(abbed_->err(), HasSubstr("the stop of the measuring machine is not confirmed"));
}

TEST_F(StoppedMachine, WithoutAConnectionTheStopIsNotSent) {
  std::optional<MachineInAThread> machine;
  machine.emplace(slow_machine());
  ASSERT_NO_FATAL_FAILURE(start_touching(*machine));
  machine.reset();  // its network is gone
  const Outcome stopped = stop();
  EXPECT_EQ(stopped.code, 7) << stopped.out;
  EXPECT_THAT(stopped.err, AllOf(HasSubstr("not sent"), HasSubstr("may be moving")));
  EXPECT_TRUE(journal_has("measuring machine: stop not sent"));
  EXPECT_EQ(abbed_->stop(), 7);
  EXPECT_THAT(abbed_->err(), HasSubstr("the stop of the measuring machine is not sent"));
}

TEST_F(StoppedMachine, TheEndOfAbbedStopsTheMachineAndSaysSo) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_touching(machine));
  EXPECT_EQ(abbed_->stop(), 0);
  EXPECT_THAT(abbed_->err(), HasSubstr("abbed: stopped"));
  EXPECT_FALSE(machine.moving());
}

TEST_F(StoppedMachine, APlaceOutsideTravelIsRefusedAndNothingIsSent) {
  MachineInAThread machine{slow_machine()};
  ASSERT_NO_FATAL_FAILURE(start_at(machine));
  ASSERT_TRUE(eventually([&] { return stream("cmm")["state"] == "ready"; })) << status().dump(1);
  auto request = touch_request();
  request["points"].push_back(request["points"][0]);
  for (const double far : {5.0, -50.0, 1e16}) {
    request["points"][1]["at_m"][0] = far;
    const auto refused = ask(request);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, daemon::ErrorCode::Refused);
    EXPECT_THAT(refused.error().text,
                AllOf(HasSubstr("point 2 of 2"), HasSubstr("[axes.X] travel")));
  }
  request["points"][1] = request["points"][0];
  request["points"][0]["normal"] = {0.0, 0.0, 0.0};
  EXPECT_THAT(ask(request).error().text, AllOf(HasSubstr("point 1 of 2"), HasSubstr("normal")));
  EXPECT_EQ(stream("cmm")["faults"], 0);
  for (const std::string& command : machine.heard())
    EXPECT_FALSE(command.starts_with("GoTo") || command.starts_with("PtMeas")) << command;
}

TEST_F(StoppedMachine, WithoutAMeasuringMachineTheStopIsRefused) {
  write_configuration_of("");
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  EXPECT_EQ(stop().code, 5);
}

}  // namespace
}  // namespace abbe::test
