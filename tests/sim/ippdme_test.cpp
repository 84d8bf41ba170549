#include <gtest/gtest.h>

#include <string>

#include "abbe/sim/ippdme_server.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

constexpr HostTime kMachineStart{100s};

IppDmeOptions with_a_sphere() {
  IppDmeOptions o;
  o.machine.spheres = {{.centre_m = {0.1, 0.2, -0.1}, .radius_m = 12.5e-3}};
  return o;
}

/// Sends one line at `at` and returns the answer until `until`; each line ends with "|".
std::string ask(IppDmeDevice& machine, const std::string& line, HostTime at = kMachineStart,
                HostTime until = kMachineStart) {
  const std::string bytes = line + "\r\n";
  machine.receive(std::as_bytes(std::span{bytes}), at);
  machine.advance(std::max(at, until));
  const auto out = machine.take_output();
  std::string text(reinterpret_cast<const char*>(out.data()), out.size());
  for (auto at_end = text.find("\r\n"); at_end != std::string::npos; at_end = text.find("\r\n"))
    text.replace(at_end, 2, "|");
  return text;
}

TEST(IppDmeDevice, RefusesCommandsOutsideASession) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  EXPECT_EQ(ask(machine, "00001 IsHomed()"),
            "00001 &|00001 ! Error(3,0008,IsHomed,\"Protocol error\")|00001 %|");
  EXPECT_EQ(ask(machine, "00002 StartSession()"), "00002 &|00002 %|");
  EXPECT_EQ(ask(machine, "00003 IsHomed()"), "00003 &|00003 # IsHomed(1)|00003 %|");
}

TEST(IppDmeDevice, RefusesASecondSession) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  (void)ask(machine, "00001 StartSession()");
  EXPECT_NE(ask(machine, "00002 StartSession()").find("Error(3,0008"), std::string::npos);
}

TEST(IppDmeDevice, RefusesCommandsAfterAnAbortUntilErrorsAreCleared) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  (void)ask(machine, "00001 StartSession()");
  EXPECT_EQ(ask(machine, "00002 GoTo(X(100))"), "00002 &|");
  EXPECT_EQ(ask(machine, "E0001 AbortE()", kMachineStart + 100ms, kMachineStart + 100ms),
            "E0001 &|00002 ! Error(2,0006,GoTo,\"Transaction aborted\")|00002 %|E0001 %|");
  EXPECT_NEAR(machine.reading_m(kMachineStart + 1s)[0], 0.02, 1e-9);  // 0.1 s of 200 mm/s
  EXPECT_NE(ask(machine, "00003 IsHomed()").find("Error(2,0514"), std::string::npos);
  EXPECT_EQ(ask(machine, "00004 ClearAllErrors()"), "00004 &|00004 %|");
  EXPECT_EQ(ask(machine, "00005 GoTo(X(20))"), "00005 &|00005 %|");
}

TEST(IppDmeDevice, ReportsAtMostTenTimesASecondWhileMoving) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  (void)ask(machine, "00001 StartSession()");
  EXPECT_EQ(ask(machine, "E0001 OnMoveReportE(Time(0.01),Dis(1),X())"), "E0001 &|");
  const std::string answer =
      ask(machine, "00002 GoTo(X(200))", kMachineStart, kMachineStart + 2s);  // 1 s
  EXPECT_EQ(
      answer,
      "00002 &|E0001 # X(0)|E0001 # X(20)|E0001 # X(40)|E0001 # X(60)|E0001 # X(80)|E0001 # X(100)|"
      "E0001 # X(120)|E0001 # X(140)|E0001 # X(160)|E0001 # X(180)|00002 %|");
}

TEST(IppDmeDevice, ReportsAMissingSurfaceAndAnIllegalTouch) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  (void)ask(machine, "00001 StartSession()");
  const std::string missed =
      ask(machine, "00002 PtMeas(X(0),Y(0),Z(0),IJK(0,0,1))", kMachineStart, kMachineStart + 60s);
  EXPECT_NE(missed.find("Error(2,1006"), std::string::npos) << missed;
  (void)ask(machine, "00003 ClearAllErrors()");
  const std::string inside = ask(machine, "00004 PtMeas(X(100),Y(200),Z(-100),IJK(0,0,1))",
                                 kMachineStart, kMachineStart + 60s);
  EXPECT_NE(inside.find("Error(2,1001"), std::string::npos) << inside;
}

TEST(MeasuringMachine, TouchesASphereAtItsTruePosition) {
  const MeasuringMachine machine{.spheres = {{.centre_m = {0.0, 0.0, 0.0}, .radius_m = 10e-3}}};
  const Eigen::Vector3d normal = Eigen::Vector3d{1.0, 2.0, 2.0} / 3.0;
  const Probing probing = probe(machine, 12.3e-3 * normal, normal, 0);
  ASSERT_FALSE(probing.fault);
  EXPECT_NEAR(probing.reading_m.norm(), 12e-3, 1e-15);
}

TEST(IppDmeDevice, TouchesTheFaceOfABlockOnlyWithinItsSquare) {
  MeasuringMachine machine;
  machine.tip_radius_m = 2e-3;
  machine.faces = {{.centre_m = {0.1, 0.1, 0.0}, .normal = {0, 0, 1}, .half_size_m = 10e-3}};
  const auto on = probe(machine, {0.105, 0.1, 2e-3}, Eigen::Vector3d::UnitZ(), 0);
  ASSERT_FALSE(on.fault);
  EXPECT_NEAR(on.reading_m.z(), 2e-3, 1e-12);
  EXPECT_EQ(probe(machine, {0.13, 0.1, 2e-3}, Eigen::Vector3d::UnitZ(), 1).fault,
            ProbingFault::NothingThere);
}

TEST(IppDmeDevice, LosesItsSessionWhenItIsMute) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  (void)ask(machine, "00001 StartSession()");
  machine.inject({.kind = FaultKind::Mute, .duration_s = 1.0}, kMachineStart);
  EXPECT_EQ(ask(machine, "00002 IsHomed()", kMachineStart + 500ms, kMachineStart + 500ms), "");
  EXPECT_NE(ask(machine, "00003 IsHomed()", kMachineStart + 1s, kMachineStart + 1s)
                .find("Protocol error"),
            std::string::npos);
}

TEST(IppDmeDevice, KeepsMovingWhenTheConnectionClosesAndKeepsTheListOfCommands) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  (void)ask(machine, "00001 StartSession()");
  (void)ask(machine, "00002 GoTo(X(200))");
  machine.disconnected();

  EXPECT_TRUE(machine.moving());
  machine.connected(kMachineStart);
  EXPECT_EQ(ask(machine, "00001 StartSession()", kMachineStart + 500ms, kMachineStart + 500ms),
            "00001 &|");  // waits for the end of the motion
  EXPECT_NE(
      ask(machine, "E0002 AbortE()", kMachineStart + 500ms, kMachineStart + 2s).find("E0002 %"),
      std::string::npos);
  EXPECT_NEAR(machine.reading_m(kMachineStart + 2s)[0], 0.1, 1e-9);
  EXPECT_EQ(machine.heard().back(), "AbortE()");
  EXPECT_EQ(machine.heard().size(), 4u);
}

TEST(IppDmeDevice, AnEmergencyStopIsNotClearedWhileItIsPressed) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  (void)ask(machine, "00001 StartSession()");
  (void)ask(machine, "00002 GoTo(X(200))");
  machine.inject({.kind = FaultKind::EmergencyStop, .duration_s = 1.0}, kMachineStart + 500ms);
  EXPECT_NEAR(machine.reading_m(kMachineStart + 2s)[0], 0.1, 1e-9);
  EXPECT_NE(ask(machine, "00003 ClearAllErrors()", kMachineStart + 600ms, kMachineStart + 600ms)
                .find("Error(3,0500"),
            std::string::npos);
  EXPECT_EQ(ask(machine, "00004 ClearAllErrors()", kMachineStart + 2s, kMachineStart + 2s),
            "00004 &|00004 %|");
}

TEST(IppDmeDevice, SendsOddTagsErrorsAndOtherCharacters) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  machine.inject({.kind = FaultKind::OddTag}, kMachineStart);
  machine.inject({.kind = FaultKind::ErrorReport, .value = 9}, kMachineStart);
  machine.inject({.kind = FaultKind::NotAscii}, kMachineStart);
  const auto answer = machine.take_output();
  const std::string_view text{reinterpret_cast<const char*>(answer.data()), answer.size()};
  EXPECT_EQ(text.substr(0, 9), "98765 %\r\n");
  EXPECT_NE(text.find("E0000 ! Error(9,0503,Machine,"), std::string::npos);
  EXPECT_NE(text.find("f\xFCr"), std::string::npos);
}

TEST(IppDmeDevice, RefusesTheNextTouchWithTheGivenError) {
  IppDmeDevice machine{with_a_sphere(), kMachineStart};
  machine.connected(kMachineStart);
  (void)ask(machine, "00001 StartSession()");
  machine.inject({.kind = FaultKind::RefuseTouch, .value = 1009}, kMachineStart);
  const auto answer = ask(machine, "00002 PtMeas(X(100),Y(200),Z(-85.5),IJK(0,0,1))", kMachineStart,
                          kMachineStart + 60s);
  EXPECT_NE(answer.find("00002 ! Error(2,1009,PtMeas"), std::string::npos) << answer;
}

}  // namespace
}  // namespace abbe::sim
