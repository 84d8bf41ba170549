#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "abbe/protocol/usbip/operations.hpp"
#include "abbe/protocol/usbip/urb.hpp"

namespace abbe::protocol::usbip {
namespace {

ExportedDevice card(std::string_view bus_id) {
  ExportedDevice d;
  d.path = FixedText<256>{"/sys/sim/1-1"};
  d.bus_id = BusId{bus_id};
  d.bus = 1;
  d.number = 2;
  d.vendor = 0x09DB;
  d.product = 0x00CA;
  return d;
}

std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i)
    value = value << 8 | std::to_integer<std::uint32_t>(bytes[at + i]);
  return value;
}

TEST(UsbipOperations, ImportRequestIsFortyBytes) {
  std::array<std::byte, 64> out{};
  ASSERT_EQ(encode_import_request(BusId{"1-1"}, out), 40u);
  EXPECT_EQ(word_at(out, 0), 0x01118003u);
  EXPECT_EQ(word_at(out, 4), 0u);
  EXPECT_EQ(std::to_integer<char>(out[8]), '1');
  EXPECT_EQ(decode_import_request(std::span{out}.first(40))->view(), "1-1");
}

TEST(UsbipOperations, ImportReplyPutsTheIdsAtTheirSpecifiedOffsets) {
  std::array<std::byte, kImportReplySize> out{};
  const auto device = card("1-1");
  ASSERT_EQ(encode_import_reply(OpStatus::Ok, &device, out), 320u);
  EXPECT_EQ(word_at(out, 8 + 288), 1u);           // bus
  EXPECT_EQ(word_at(out, 8 + 292), 2u);           // device
  EXPECT_EQ(word_at(out, 8 + 296), 3u);           // high speed
  EXPECT_EQ(word_at(out, 8 + 300), 0x09DB00CAu);  // vendor, product
  EXPECT_EQ(decode_import_reply(out), (ImportReply{OpStatus::Ok, device}));
}

TEST(UsbipOperations, ARefusedImportIsItsHead) {
  std::array<std::byte, 16> out{};
  ASSERT_EQ(encode_import_reply(OpStatus::NoDevice, nullptr, out), 8u);
  EXPECT_EQ(decode_import_reply(std::span{out}.first(8))->status, OpStatus::NoDevice);
}

TEST(UsbipOperations, DistinguishesATruncatedMessageFromAnotherVersion) {
  std::array<std::byte, 64> out{};
  (void)encode_import_request(BusId{"1-1"}, out);
  EXPECT_EQ(decode_import_request(std::span{out}.first(39)).error(), OpError::Truncated);
  out[1] = std::byte{0x06};
  EXPECT_EQ(decode_import_request(std::span{out}.first(40)).error(), OpError::BadVersion);
}

TEST(UsbipOperations, DeviceListHasEachDeviceAsTheImportReplyAndItsInterfaces) {
  std::array<std::byte, 1024> out{};
  DeviceListWriter writer{out, 2};
  const std::array devices{card("1-1"), card("1-2")};
  for (const auto& device : devices) {
    ASSERT_TRUE(writer.add(device, std::array{ExportedInterface{0xFF, 0, 0}}));
  }

  const auto list = writer.written();
  ASSERT_EQ(list.size(), 12u + 2 * 316u);
  EXPECT_EQ(word_at(list, 0), 0x01110005u);
  EXPECT_EQ(word_at(list, 8), 2u);
  for (std::size_t i = 0; i < devices.size(); ++i) {
    std::array<std::byte, kImportReplySize> reply{};
    (void)encode_import_reply(OpStatus::Ok, &devices[i], reply);
    const auto at = list.subspan(12 + i * 316, 316);
    EXPECT_TRUE(std::ranges::equal(at.first(312), std::span{reply}.subspan(8))) << i;
    EXPECT_EQ(word_at(at, 312), 0xFF000000u) << i;
  }
}

TEST(UsbipUrb, SubmitPutsItsSetupAtTheEnd) {
  const Submit submit{
      .head = {.sequence = 7, .device = 0x10002, .direction = Direction::In, .endpoint = 0},
      .length = 2,
      .setup = usb::encode(usb::Setup{0xC0, 0xB4, 0, 0, 2})};
  const auto bytes = encode(Urb{submit});
  EXPECT_EQ(word_at(bytes, 0), 1u);
  EXPECT_EQ(word_at(bytes, 4), 7u);
  EXPECT_EQ(word_at(bytes, 12), 1u);
  EXPECT_EQ(word_at(bytes, 24), 2u);
  EXPECT_EQ(std::to_integer<int>(bytes[40]), 0xC0);
  EXPECT_EQ(std::get<Submit>(*decode_urb(bytes)), submit);
}

TEST(UsbipUrb, RepliesSurviveTheWire) {
  const SubmitReply reply{
      .head = {.sequence = 9}, .status = UrbStatus::Stalled, .length = 512, .errors = 1};
  EXPECT_EQ(std::get<SubmitReply>(*decode_urb(encode(Urb{reply}))), reply);
  const UnlinkReply unlinked{.head = {.sequence = 10}, .status = UrbStatus::Unlinked};
  EXPECT_EQ(word_at(encode(Urb{unlinked}), 20), 0xFFFFFF98u);  // -104
  EXPECT_EQ(std::get<UnlinkReply>(*decode_urb(encode(Urb{unlinked}))), unlinked);
  const Unlink unlink{.head = {.sequence = 11}, .victim = 9};
  EXPECT_EQ(std::get<Unlink>(*decode_urb(encode(Urb{unlink}))), unlink);
}

/// Linux copies the value into the urb of its host controller, which takes it for a count.
TEST(UsbipUrb, ASubmitHasNoIsochronousPacketsAsFromLinux) {
  EXPECT_EQ(word_at(encode(Urb{Submit{}}), 32), 0u);
}

TEST(UsbipUrb, TakesBothEncodingsOfNotIsochronous) {
  auto bytes = encode(Urb{Submit{}});
  for (std::size_t i = 32; i < 36; ++i) bytes[i] = std::byte{0xFF};
  EXPECT_TRUE(decode_urb(bytes));
  for (std::size_t i = 32; i < 36; ++i) bytes[i] = std::byte{0};
  EXPECT_TRUE(decode_urb(bytes));
  bytes[35] = std::byte{1};
  EXPECT_EQ(decode_urb(bytes).error(), UrbError::Isochronous);
}

TEST(UsbipUrb, RefusesMessagesThatAreNoTransfer) {
  auto bytes = encode(Urb{Unlink{}});
  bytes[3] = std::byte{9};
  EXPECT_EQ(decode_urb(bytes).error(), UrbError::UnknownCommand);
  bytes = encode(Urb{Unlink{}});
  bytes[12] = std::byte{1};
  EXPECT_EQ(decode_urb(bytes).error(), UrbError::BadDirection);
}

}  // namespace
}  // namespace abbe::protocol::usbip
