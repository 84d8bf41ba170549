// EMCY in words: how often, and for how long.
#include "abbe/drivers/can/emergency_reports.hpp"

#include <gmock/gmock.h>

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
