#include "abbe/drivers/usb/libusb_link.hpp"

#include <gmock/gmock.h>

#include "abbe/drivers/counter_card/device.hpp"
#include "fake_libusb.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

class LibusbLinkTest : public ::testing::Test {
 protected:
  LibusbLinkTest() { fake_bus = {}; }
  ~LibusbLinkTest() override { fake_bus = {}; }
  static drivers::UsbIdentity card(const std::string& serial) {
    drivers::CounterCardOptions options;
    options.serial = serial;
    return drivers::identity_of(options);
  }
  /// Of the event that open() led to; empty: opened.
  std::string opened(drivers::LibusbLink& link) {
    link.open();
    for (const auto& event : link.wait(0ns))
      if (const auto* lost = std::get_if<drivers::UsbLost>(&event)) return lost->error.text;
    return {};
  }

  SteppedTime time_;
  libusb_device ours_{.serial = "A", .address = 1}, other_{.serial = "B", .address = 2};
};

TEST_F(LibusbLinkTest, OpensAnotherCardOnceAndNotAgainWhileItStaysPluggedIn) {
  fake_bus.devices = {&other_};
  drivers::LibusbLink link{card("A"), time_};
  for (int i = 0; i < 10; ++i) EXPECT_THAT(opened(link), HasSubstr("its serial number is \"B\""));
  EXPECT_EQ(other_.opened, 1);
  other_.address = 3;  // plugged in again
  (void)opened(link);
  EXPECT_EQ(other_.opened, 2);
  fake_bus.devices = {&other_, &ours_};
  EXPECT_EQ(opened(link), "");
  EXPECT_EQ(other_.opened, 2);
}

TEST_F(LibusbLinkTest, TwoCardsWithoutASerialNumberAreReportedWithoutReopeningThem) {
  fake_bus.devices = {&ours_, &other_};
  drivers::LibusbLink link{card(""), time_};
  for (int i = 0; i < 10; ++i)
    EXPECT_THAT(opened(link), HasSubstr("2 such devices are connected (A, B)"));
  EXPECT_EQ(ours_.opened + other_.opened, 2);
}

TEST_F(LibusbLinkTest, TransfersThatDoNotComeBackAreNeitherFreedNorUsedAgain) {
  fake_bus.devices = {&ours_};
  drivers::LibusbLink link{card("A"), time_};
  ASSERT_EQ(opened(link), "");
  link.start_bulk_in({.transfer_bytes = 512, .in_flight = 4});
  fake_bus.keeps_cancelled = true;
  link.close();
  EXPECT_THAT(opened(link), HasSubstr("the USB host controller hangs"));
  EXPECT_EQ(fake_bus.freed, 0);
  fake_bus.keeps_cancelled = false;
  EXPECT_EQ(opened(link), "");
  link.start_bulk_in({.transfer_bytes = 512, .in_flight = 4});
  EXPECT_EQ(fake_bus.submitted.size(), 4u);
}

TEST_F(LibusbLinkTest, AtItsEndTransfersThatAreStillOutAreLeftToTheLibrary) {
  fake_bus.devices = {&ours_};
  {
    drivers::LibusbLink link{card("A"), time_};
    ASSERT_EQ(opened(link), "");
    link.start_bulk_in({.transfer_bytes = 512, .in_flight = 4});
    fake_bus.keeps_cancelled = true;
  }
  EXPECT_EQ(fake_bus.freed, 0);
}

}  // namespace
}  // namespace abbe::tests
