#pragma once
/// The encoder device on a UDP socket of 127.0.0.1 and what it talks to there.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "encoder_peer.hpp"

namespace abbe::drivers {

/// Two nodes and the device on one stepped clock. A turn is 1 ms, a SYNC period 4 ms.
class EncoderDeviceOnUdp : public testing::Test {
 protected:
  static constexpr std::chrono::milliseconds kTurn{1};

  explicit EncoderDeviceOnUdp(std::vector<can::EncoderIdentity> identities = {{.node = 1}, {.node = 2}})
      : peer(identities) {}
  [[nodiscard]] UdpCanOptions udp() const { return {.peer_port = peer.port(), .speed = 0.0}; }
  virtual std::unique_ptr<CanBus> make_bus() { return std::make_unique<UdpCanBus>(udp(), time); }
  static EncoderReceiverOptions two_axes() {
    EncoderReceiverOptions options;
    options.axes = {{.name = "X", .node = 1}, {.name = "Y", .node = 2}};
    options.sync_period = 4 * kTurn;
    return options;
  }
  void SetUp() override {
    EncoderDeviceOptions options;
    options.receiver = two_axes();
    auto made = EncoderDevice::create(options, make_bus(), time);
    EXPECT_TRUE(made.has_value());
    device = std::move(*made);
  }

  void turn() {
    peer.serve(time.now());
    peer.answer_sync();
    device->wait(kTurn);
    device->receive();
    time.advance(kTurn);
    std::array<protocol::AxisSample, 64> out{};
    const auto n = device->samples().pop(out);
    samples.insert(samples.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
    std::array<protocol::RawBlock, 256> blocks;  // NOLINT: filled by pop
    const auto raw_count = device->raw().pop(blocks);
    raw.insert(raw.end(), blocks.begin(), blocks.begin() + static_cast<std::ptrdiff_t>(raw_count));
  }
  void turns(int n) {
    for (int i = 0; i < n; ++i) turn();
  }
  template <class Done>
  bool turns_until(Done done, int limit = 5000) {
    for (int i = 0; i < limit && !done(); ++i) turn();
    return done();
  }
  bool state_becomes(std::string_view state) {
    return turns_until([&] { return device->status().state == state; });
  }
  void begin_streaming() {
    ASSERT_TRUE(state_becomes("streaming")) << device->status().last_fault;
    ASSERT_TRUE(turns_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }));
    samples.clear();
  }
  /// `untold`: flags that raw bytes do not carry.
  void expect_the_same_from_raw_bytes(protocol::SampleFlags untold = 0) const {
    EncoderReceiver replay{two_axes()};
    std::vector<protocol::AxisSample> replayed;
    for (const auto& block : raw)
      replay.on_raw(block, [&](const protocol::AxisSample& s) { replayed.push_back(s); });
    ASSERT_GT(replayed.size(), samples.size());  // begin_streaming() forgot the first ones
    const auto* tail = &replayed[replayed.size() - samples.size()];
    for (std::size_t i = 0; i < samples.size(); ++i) {
      EXPECT_EQ(tail[i].head.time, samples[i].head.time);
      EXPECT_EQ(tail[i].head.flags, samples[i].head.flags & ~untold);
      EXPECT_EQ(tail[i].missing_mask, samples[i].missing_mask);
      EXPECT_EQ(tail[i].count, samples[i].count);
      EXPECT_EQ(std::memcmp(&tail[i].position, &samples[i].position, sizeof samples[i].position), 0);
    }
  }

  SteppedTime time;
  tests::EncoderPeer peer;
  std::unique_ptr<EncoderDevice> device;
  std::vector<protocol::AxisSample> samples;
  std::vector<protocol::RawBlock> raw;
};

}  // namespace abbe::drivers
