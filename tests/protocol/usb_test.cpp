#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/protocol/usb/setup.hpp"

namespace abbe::protocol::usb {
namespace {

template <class... B>
std::vector<std::byte> bytes(B... b) {
  return {static_cast<std::byte>(b)...};
}

TEST(UsbSetup, IsEightLittleEndianBytes) {
  const auto encoded = encode(usb::Setup{0x40, 0xB4, 0x1234, 0x005D, 0x0002});
  EXPECT_EQ(std::vector(encoded.begin(), encoded.end()),
            bytes(0x40, 0xB4, 0x34, 0x12, 0x5D, 0x00, 0x02, 0x00));
  EXPECT_EQ(decode_setup(encoded), (usb::Setup{0x40, 0xB4, 0x1234, 0x005D, 0x0002}));
}

TEST(UsbSetup, RequestsStringsInEnglish) {
  const auto setup = get_descriptor(DescriptorType::String, 3, 255);
  EXPECT_EQ(setup.value, 0x0303);
  EXPECT_EQ(setup.index, 0x0409);
  EXPECT_TRUE(setup.device_to_host());
}

TEST(UsbDescriptors, DeviceDescriptorSurvivesTheWire) {
  const DeviceDescriptor d{.vendor = 0x09DB, .product = 0x00CA, .serial_string = 3};
  const auto encoded = encode(d);
  EXPECT_EQ(std::to_integer<int>(encoded[0]), 18);
  EXPECT_EQ(std::to_integer<int>(encoded[8]), 0xDB);
  EXPECT_EQ(std::to_integer<int>(encoded[9]), 0x09);
  EXPECT_EQ(decode_device_descriptor(encoded), d);
}

TEST(UsbDescriptors, RefusesAShortDeviceDescriptor) {
  const auto encoded = encode(DeviceDescriptor{});
  EXPECT_FALSE(decode_device_descriptor(std::span{encoded}.first(17)));
}

TEST(UsbDescriptors, ReadsAStringAsAscii) {
  const auto text = decode_string(bytes(8, 3, 'A', 0, 0xE9, 0, '7', 0));
  ASSERT_TRUE(text);
  EXPECT_EQ(text->view(), "A?7");
}

TEST(UsbDescriptors, RefusesAStringWhoseLengthExceedsTheBuffer) {
  EXPECT_FALSE(decode_string(bytes(8, 3, 'A', 0)));
}

TEST(UsbDescriptors, StringSurvivesTheWire) {
  std::array<std::byte, kMaxDescriptor> out{};
  const auto size = encode_string("01A2B3C4", out);
  EXPECT_EQ(size, 18u);
  EXPECT_EQ(decode_string(std::span{out}.first(size))->view(), "01A2B3C4");
}

TEST(UsbDescriptors, FindsAnEndpointBehindItsInterface) {
  const auto configuration =
      bytes(9, 2, 25, 0, 1, 1, 0, 0x80, 50, 9, 4, 0, 0, 1, 0xFF, 0, 0, 0, 7, 5, 0x82, 2, 0, 2, 0);
  EXPECT_EQ(find_endpoint(configuration, 0x82), 512);
  EXPECT_FALSE(find_endpoint(configuration, 0x81));
}

TEST(UsbDescriptors, EndsOnADescriptorOfLengthZero) {
  EXPECT_FALSE(find_endpoint(bytes(0, 5, 0x82, 2, 0, 2, 0), 0x82));
}

}  // namespace
}  // namespace abbe::protocol::usb
