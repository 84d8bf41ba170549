// The encoder driver in the conformance suite: two nodes behind a UDP socket.

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/udp_can_bus.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "driver_conformance.hpp"
#include "encoder_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

class EncoderConformancePeer {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 1ms;
  static constexpr std::chrono::nanoseconds kSilenceLimit = 400ms;
  // SDO retries 1.5 s, then a pause of 1 s
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 4s;
  static constexpr bool kTornCanBeFinished = false;

  static std::set<std::string_view> shown(Fault fault) {
    switch (fault) {
      case Fault::None:
        return {"streaming"};
      case Fault::Mute:
        return {"degraded", "silent", "configuring"};
      case Fault::Garbage:
        return {"streaming"};
      case Fault::Unplugged:
        return {"silent"};
      case Fault::Restart:
        return {"degraded", "configuring"};
    }

    return {};
  }

  EncoderConformancePeer() {
    drivers::EncoderDeviceOptions options;
    options.receiver.axes = {{.name = "X", .node = 1}, {.name = "Y", .node = 2}};
    options.receiver.sync_period = 4ms;
    options.sample_capacity = 64;
    options.raw_capacity_blocks = 64;  // not read here: always full
    auto bus = std::make_unique<drivers::UdpCanBus>(
        drivers::UdpCanOptions{.peer_port = peer_.port(), .speed = 0.0}, time_);
    device_ = std::move(*drivers::EncoderDevice::create(options, std::move(bus), time_));
  }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<protocol::AxisSample, 64> out{};
    const auto n = device_->samples().pop(out);
    for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
  }
  void serve() { peer_.serve(time_.now()); }
  void send_valid() {
    const auto frames = peer_.take_answer();
    if (frames.empty()) return;
    if (!holding_) return peer_.send(frames);
    if (held_.empty()) held_ = frames;
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    if (!held_.empty()) peer_.send(held_);
    held_.clear();
  }
  void send_torn() {
    std::array<std::byte, 64> buffer{};
    protocol::can::DatagramWriter writer{buffer, 0};
    (void)writer.add(can::encode_position(0x181, can::PositionType::Signed32, 1));
    const auto whole = writer.finish();
    peer_.send_bytes(whole.first(whole.size() / 2));
  }
  void finish_torn() {}
  void send_garbage() { peer_.send_bytes(std::as_bytes(std::span{"no CAN frames at all"})); }
  /// The cable, not the peer: what the device sends gets lost.
  void unplug() {}
  void plug_in() { peer_.drain(); }
  /// A cycle gives one sample for any number of answers; only a bus that is switched off and on
  /// gives many at once.
  void flood() {
    std::vector<can::CanFrame> frames;
    for (int i = 0; i < 200; ++i) {
      for (const auto c : {can::BusCondition::BusOff, can::BusCondition::Active}) {
        frames.push_back(
            can::encode_error_frame({.conditions = static_cast<can::BusConditions>(c)}));
      }
    }
    peer_.send(frames);
  }
  void restart() { peer_.restart(); }

 private:
  SteppedTime time_;
  EncoderPeer peer_{std::array{can::EncoderIdentity{.node = 1}, can::EncoderIdentity{.node = 2}}};
  std::unique_ptr<drivers::EncoderDevice> device_;
  bool holding_ = false;
  std::vector<can::CanFrame> held_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Encoder, DriverConformance, EncoderConformancePeer);

}  // namespace
}  // namespace abbe::tests
