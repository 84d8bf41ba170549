#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "abbe/protocol/quad08/sequences.hpp"
#include "abbe/protocol/quad08/stream.hpp"
#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/sim/counter_card_setup.hpp"
#include "abbe/sim/usbip_server.hpp"
#include "loopback_client.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;

constexpr double kClock_hz = 1e6;
const HostTime kCardStart{1h};

CounterCardOptions options() {
  CounterCardOptions card;
  card.channels[0].phases =
      ScaleSignal{.reading = [](HostTime t) { return 0.5 * ns_to_seconds(t - kCardStart); },
                  .step = 1e-6,
                  .noise = 0.0,
                  .marks = {}};
  card.channels[5].phases = ClockSignal{.hz = kClock_hz};
  card.channels[6] = {ClockSignal{.hz = kClock_hz}, true};
  card.channels[7].phases = ProbeSignal{};
  card.fifo_bytes = 4096;
  return card;
}

quad08::ScanLayout layout() {
  quad08::ScanLayout layout{.width = quad08::CountWidth::Bits32};
  for (const unsigned channel : {0u, 5u, 6u, 7u})
    layout.channels[layout.count++] = static_cast<std::uint8_t>(channel);
  return layout;
}

class CounterCardTest : public testing::Test {
 protected:
  void run(const quad08::Sequence& sequence, HostTime at) {
    for (const auto& step : sequence.steps())
      EXPECT_TRUE(card_.control(step.setup, at).has_value());
  }
  void set_up(std::uint8_t channel, const quad08::CounterSetup& setup, HostTime at) {
    for (const auto& write : quad08::channel_writes(channel, setup, {}, {}))
      (void)card_.control(write, at);
  }
  /// 1000 scans per second of scale, clock, latch and edges, set up and started at kCardStart.
  void start() {
    set_up(0, {.mode = quad08::CounterMode::Encoder}, kCardStart);
    set_up(5, {}, kCardStart);
    set_up(6, {.latch_on_index = true}, kCardStart);
    set_up(7, {}, kCardStart);
    run(quad08::load_sequence(layout(), *quad08::pacer_divisor(1000.0)), kCardStart);
    run(quad08::arm_sequence(), kCardStart);
    (void)card_.control(quad08::start_pacer(), kCardStart);
  }
  std::vector<quad08::RawScan> scans() {
    quad08::ScanDecoder decoder{layout()};
    const auto bytes = card_.take(1 << 20);
    decoder.push(bytes);
    std::vector<quad08::RawScan> all;
    while (const auto scan = decoder.next()) all.push_back(*scan);
    return all;
  }
  [[nodiscard]] quad08::Status status() {
    const auto answer = card_.control(quad08::read(quad08::Register::Acquisition), kCardStart);
    return {*quad08::decode_word(*answer)};
  }
  CounterCard card_{options()};
};

TEST_F(CounterCardTest, CountsFromThePositionAtSetUp) {
  start();
  card_.advance(kCardStart + 10ms, 0);
  const auto all = scans();
  ASSERT_EQ(all.size(), 10u);
  EXPECT_EQ(all[0][0], 500u);  // 0.5 m/s, 1 um, after 1 ms
  EXPECT_EQ(all[9][1], 10'000u);
  EXPECT_EQ(all[9][2], 0u);  // no probe edge yet
}

TEST_F(CounterCardTest, LatchesTheClockAtTheEdgeOfTheProbe) {
  start();
  card_.add_probe_edge(kCardStart + 4321us);
  card_.advance(kCardStart + 6ms, 0);
  const auto all = scans();
  EXPECT_EQ(all[3][2], 0u);
  EXPECT_EQ(all[4][2], 4321u);
  EXPECT_EQ(all[3][3], 0u);
  EXPECT_EQ(all[4][3], 1u);
}

TEST_F(CounterCardTest, OverrunsWhenTheHostDoesNotRead) {
  start();
  card_.advance(kCardStart + 200ms, 0);
  EXPECT_FALSE(status().overrun());
  card_.advance(kCardStart + 300ms, 0);  // 4096 bytes are 256 scans
  EXPECT_TRUE(status().overrun());
  EXPECT_EQ(scans().size(), 256u);
  run(quad08::stop_sequence(), kCardStart + 300ms);
  EXPECT_FALSE(status().overrun());
}

TEST_F(CounterCardTest, KeepsItsCountsOverARestartOfTheScan) {
  start();
  card_.advance(kCardStart + 5ms, 0);
  (void)scans();
  run(quad08::load_sequence(layout(), *quad08::pacer_divisor(1000.0)), kCardStart + 50ms);
  run(quad08::arm_sequence(), kCardStart + 50ms);
  (void)card_.control(quad08::start_pacer(), kCardStart + 50ms);
  card_.advance(kCardStart + 52ms, 0);
  EXPECT_EQ(scans().front()[1], 51'000u);
}

TEST_F(CounterCardTest, CountersCanBeReadByRegister) {
  set_up(0, {.mode = quad08::CounterMode::Encoder, .register_reading = true}, kCardStart);
  (void)card_.control(quad08::write(quad08::Register::CounterBank, 0), kCardStart);
  const auto low = card_.control(quad08::read(quad08::Register::CounterWord0), kCardStart + 10ms);
  EXPECT_EQ(quad08::decode_word(*low), 5000);
}

TEST_F(CounterCardTest, StallsUnknownRequests) {
  EXPECT_FALSE(card_.control({0xC0, 0x77, 0, 0, 2}, kCardStart).has_value());
  EXPECT_FALSE(card_.control(usb::get_descriptor(usb::DescriptorType::String, 9, 255), kCardStart)
                   .has_value());
}

TEST(DistanceCodedMarks, HaveTheDistancesOfTheFormula) {
  const auto marks = distance_coded_marks(0.0, 1.0, 1000, 5);
  // Distances 501, 499, 502, 498, ... signal periods.
  for (std::size_t i = 0; i + 2 < marks.size(); i += 2) {
    EXPECT_EQ(marks[i + 1] - marks[i], 501.0 + static_cast<double>(i) / 2.0);
    EXPECT_EQ(marks[i + 2] - marks[i + 1], 499.0 - static_cast<double>(i) / 2.0);
  }
}

TEST(UsbipServer, ListsTheCardForUsbipAttach) {
  auto server = UsbipServer::open(0, options());
  ASSERT_TRUE(server);
  const Socket client = test::connected(SOCK_STREAM, server->port());
  // version 1.1.1, request of the device list, status 0
  constexpr std::array<std::byte, 8> kRequest{std::byte{0x01}, std::byte{0x11}, std::byte{0x80},
                                              std::byte{0x05}};
  test::send_bytes(client, kRequest);
  for (int i = 0; i < 50; ++i) server->poll(kCardStart);
  const auto answer = test::receive_bytes(client);
  // the head, the number of devices, then the device as in an import reply
  ASSERT_GE(answer.size(), 12 + usbip::kExportedDeviceSize);
  EXPECT_EQ(answer[11], std::byte{1});
  std::array<std::byte, usbip::kImportReplySize> reply{};
  const usbip::ExportedDevice any;
  (void)usbip::encode_import_reply(usbip::OpStatus::Ok, &any, reply);
  std::copy_n(answer.begin() + 12, usbip::kExportedDeviceSize, reply.begin() + usbip::kOpHeadSize);
  const auto device = usbip::decode_import_reply(reply)->device;
  EXPECT_EQ(device.bus_id.view(), "1-1");
  EXPECT_EQ(device.vendor, quad08::kVendor);
  EXPECT_EQ(device.product, quad08::kProduct);
}

TEST(UsbipServer, RefusesABusIdItDoesNotHave) {
  auto server = UsbipServer::open(0, options());
  ASSERT_TRUE(server);
  const Socket client = test::connected(SOCK_STREAM, server->port());
  std::array<std::byte, usbip::kImportRequestSize> request{};
  (void)usbip::encode_import_request(usbip::BusId{"3-7"}, request);
  test::send_bytes(client, request);
  for (int i = 0; i < 50; ++i) server->poll(kCardStart);
  const auto reply = usbip::decode_import_reply(test::receive_bytes(client));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->status, usbip::OpStatus::NoDevice);
}

}  // namespace
}  // namespace abbe::sim
