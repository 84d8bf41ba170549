// EMCY in words: how often, and for how long.
#include "abbe/drivers/can/emergency_reports.hpp"

#include <gmock/gmock.h>

#include "abbe/protocol/can/control_emergency.hpp"
#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using encoder_line::kStart;
using encoder_line::three_axes;
using protocol::HostTime;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Reports {
  void emcy(std::uint16_t code, HostTime at, can::NodeId node = 1) {
    reports.on_frame(can::encode_emergency({.node = node, .code = code, .error_register = 0x11}),
                     at);
  }
  std::vector<EncoderAxis> axes = three_axes().axes;
  EmergencyReports reports{axes};
};

TEST(EmergencyReports, GiveOneFaultASecondOfANodeWhateverItSends) {
  Reports r;
  std::size_t faults = 0;
  for (int i = 0; i < 5000; ++i) {
    const auto now = kStart + 1ms * i;
    r.emcy(i % 2 == 0 ? 0x5000 : 0x8130, now);
    while (r.reports.take_fault(now)) ++faults;
  }
  EXPECT_EQ(faults, 5u);
}

TEST(EmergencyReports, ReportAnotherCodeWithinTheSecondAfterIt) {
  Reports r;
  r.emcy(0x5000, kStart);
  EXPECT_THAT(r.reports.take_fault(kStart).value_or(""), HasSubstr("5000h"));
  r.emcy(0x8130, kStart + 1ms);
  r.emcy(0x8120, kStart + 2ms);
  r.emcy(0x8130, kStart + 3ms, 2);
  EXPECT_THAT(r.reports.take_fault(kStart + 3ms).value_or(""), HasSubstr("(node 2)"));
  EXPECT_FALSE(r.reports.take_fault(kStart + 999ms));
  EXPECT_THAT(r.reports.take_fault(kStart + 1s).value_or(""),
              AllOf(HasSubstr("8120h"), HasSubstr("1 others")));
  EXPECT_FALSE(r.reports.take_fault(kStart + 1h));
}

TEST(EmergencyReports, GiveOneFaultForTheCauseThatAControlRepeats) {
  Reports r;
  std::vector<std::string> faults;
  const auto control = [&](std::optional<can::ControlCause> cause, HostTime at) {
    r.reports.on_frame(can::encode_emergency(can::control_emergency(1, cause)), at);
    while (const auto text = r.reports.take_fault(at)) faults.push_back(*text);
  };
  for (int i = 0; i < 5; ++i) control(can::ControlCause::NotHomed, kStart + 1s * i);
  EXPECT_THAT(faults, testing::ElementsAre("encoder XYZ1 (node 1): LinuxCNC is not homed"));
  EXPECT_EQ(r.reports.condition(0b001, kStart + 5s),
            "XYZ1 missing (node 1): LinuxCNC is not homed");

  control(std::nullopt, kStart + 6s);
  EXPECT_EQ(r.reports.condition(0, kStart + 6s), "");
  control(can::ControlCause::NotHomed, kStart + 7s);
  EXPECT_EQ(faults.size(), 2u) << "once more";
}

TEST(EmergencyReports, ClearTheEmergencyOfARecoveredAxis) {
  Reports r;
  r.emcy(0x5000, kStart);
  (void)r.reports.take_fault(kStart);
  r.emcy(0, kStart + 1s);
  EXPECT_THAT(r.reports.condition(0b001, kStart + 2s), HasSubstr("EMCY 5000h"));
  EXPECT_EQ(r.reports.condition(0, kStart + 3s), "");
  EXPECT_THAT(r.reports.condition(0b001, kStart + 11s), HasSubstr("EMCY 5000h"))
      << "not well for long";
  EXPECT_EQ(r.reports.condition(0, kStart + 11s + EmergencyReports::kSettledAfter), "");
  EXPECT_THAT(r.reports.condition(0b001, kStart + 1h),
              AllOf(HasSubstr("missing"), Not(HasSubstr("EMCY"))));
}

}  // namespace
}  // namespace abbe::drivers
