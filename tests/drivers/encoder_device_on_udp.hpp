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
#include "abbe/protocol/can/error_frame.hpp"
#include "encoder_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::drivers {

/// UDP that can fail as an interface that goes down does.
class FailingBus final : public CanBus {
 public:
  FailingBus(const UdpCanOptions& options, const TimeSource& time) : udp_(options, time) {}

  void fail_next_read() { fails_ = true; }
  [[nodiscard]] std::uint16_t local_port() const { return udp_.local_port(); }

  Result<void> open(std::span<const std::uint32_t> ids) override { return udp_.open(ids); }
  void close() noexcept override { udp_.close(); }
  Result<CanRead> read(std::span<ReceivedFrame> out, std::chrono::nanoseconds wall) override {
    if (!std::exchange(fails_, false)) return udp_.read(out, wall);
    return tl::unexpected(Error{ErrorCode::SystemRefused, "CAN test: read: Network is down"});
  }
  Result<void> send(std::span<const can::CanFrame> frames) override { return udp_.send(frames); }
  [[nodiscard]] CanBusCounters counters() const noexcept override { return udp_.counters(); }
  [[nodiscard]] std::string name() const override { return udp_.name(); }
  [[nodiscard]] std::string foreign_sender() const override { return udp_.foreign_sender(); }

 private:
  UdpCanBus udp_;
  bool fails_ = false;
};

/// Two nodes and the device on one stepped clock. A cycle is 1 ms, a SYNC period 4 ms.
class EncoderDeviceOnUdp : public testing::Test {
 protected:
  static constexpr std::chrono::milliseconds kCycle{1};
  static constexpr int kCyclesPerSync = 4;

  explicit EncoderDeviceOnUdp(std::vector<can::EncoderIdentity> identities = {{.node = 1},
                                                                              {.node = 2}})
      : peer(identities) {}
  [[nodiscard]] UdpCanOptions udp() const { return {.peer_port = peer.port(), .speed = 0.0}; }
  virtual std::unique_ptr<CanBus> make_bus() {
    auto made = std::make_unique<FailingBus>(udp(), time);
    bus = made.get();
    return made;
  }
  static EncoderReceiverOptions two_axes() {
    EncoderReceiverOptions options;
    options.axes = {{.name = "X", .node = 1}, {.name = "Y", .node = 2}};
    options.sync_period = kCyclesPerSync * kCycle;
    return options;
  }
  void SetUp() override {
    EncoderDeviceOptions options;
    options.receiver = two_axes();
    auto made = EncoderDevice::create(options, make_bus(), time);
    EXPECT_TRUE(made.has_value());
    device = std::move(*made);
  }

  void cycle() {
    peer.serve(time.now());
    peer.answer_sync();
    device->wait(kCycle);
    device->receive();
    time.advance(kCycle);
    std::array<protocol::AxisSample, 64> out{};
    const auto n = device->samples().pop(out);
    samples.insert(samples.end(), out.begin(), out.begin() + static_cast<std::ptrdiff_t>(n));
    std::array<protocol::RawBlock, 256> blocks;  // NOLINT: filled by pop
    const auto raw_count = device->raw().pop(blocks);
    raw.insert(raw.end(), blocks.begin(), blocks.begin() + static_cast<std::ptrdiff_t>(raw_count));
  }
  /// The controller of the device reports this.
  void send_condition(can::BusCondition condition) {
    peer.send(std::array{
        can::encode_error_frame({.conditions = static_cast<can::BusConditions>(condition)})});
    device->wait(kCycle);
    device->receive();
  }
  /// Cycles without a received frame: a frame would show that the bus is back.
  void bus_is_off_for(int turns) {
    send_condition(can::BusCondition::BusOff);
    for (int i = 0; i < turns; ++i) {
      device->wait(kCycle);
      device->receive();
      time.advance(kCycle);
    }
    EXPECT_EQ(device->status().state, "bus off");
  }
  void turns(int n) {
    for (int i = 0; i < n; ++i) cycle();
  }
  template <class Done>
  bool cycles_until(Done done, int limit = 5000) {
    for (int i = 0; i < limit && !done(); ++i) cycle();
    return done();
  }
  bool state_becomes(std::string_view state) {
    return cycles_until([&] { return device->status().state == state; });
  }
  void begin_streaming() {
    ASSERT_TRUE(state_becomes("streaming")) << device->status().last_fault;
    ASSERT_TRUE(cycles_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }));
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
      EXPECT_EQ(std::memcmp(&tail[i].position, &samples[i].position, sizeof samples[i].position),
                0);
    }
  }

  tests::SteppedTime time;
  tests::EncoderPeer peer;
  FailingBus* bus = nullptr;  ///< the device's
  std::unique_ptr<EncoderDevice> device;
  std::vector<protocol::AxisSample> samples;
  std::vector<protocol::RawBlock> raw;
};

}  // namespace abbe::drivers
