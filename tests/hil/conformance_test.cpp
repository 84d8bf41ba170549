// The encoder driver in the conformance suite of all drivers, on a virtual CAN bus of the kernel.

#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/can/socket_can_bus.hpp"
#include "driver_conformance.hpp"
#include "stepped_time.hpp"
#include "vcan_nodes.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

class VcanConformancePeer {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 1ms;
  static constexpr std::chrono::nanoseconds kSilenceLimit = 400ms;
  // SDO retries 1.5 s, then a pause of 1 s
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 4s;
  static constexpr bool kTornCanBeFinished = false;

  VcanConformancePeer() {
    drivers::EncoderDeviceOptions options;
    options.receiver.axes = {{.name = "X", .node = 1}, {.name = "Y", .node = 2}};
    options.receiver.sync_period = 4ms;
    options.sample_capacity = 16;      // the bus hands over 64 frames per cycle
    options.raw_capacity_blocks = 64;  // not read here: always full
    auto bus = std::make_unique<drivers::SocketCanBus>(
        drivers::SocketCanOptions{.interface = vcan_.name(), .speed = 0.0}, time_);
    device_ = std::move(*drivers::EncoderDevice::create(options, std::move(bus), time_));
  }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<protocol::AxisSample, 64> out{};
    const auto n = device_->samples().pop(out);
    for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
  }
  void serve() { nodes_.serve(time_.now()); }
  void send_valid() {
    const auto frames = nodes_.take_answer();
    if (frames.empty()) return;
    if (!holding_) return nodes_.send(frames);
    if (held_.empty()) held_ = frames;
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    if (!held_.empty()) nodes_.send(held_);
    held_.clear();
  }
  /// A frame is never torn on a bus; what a confused node sends is a position without its last
  /// bytes.
  void send_torn() { (void)nodes_.socket().send(can::standard_frame(0x181, {1, 2})); }
  void finish_torn() {}
  void send_garbage() {
    auto extended = can::standard_frame(0x181, {1, 2, 3, 4});
    extended.set(can::FrameFlag::Extended);
    const std::array frames{extended, can::standard_frame(0x7FF, {9}),
                            can::standard_frame(0x182, {})};
    (void)nodes_.socket().send(frames);
  }
  void unplug() { vcan_.down(); }
  void plug_in() {
    vcan_.up();
    nodes_.drain();
  }
  /// A cycle gives one sample for any number of answers; only a bus that is switched off and on
  /// gives many at once.
  void flood() {
    for (int i = 0; i < 100; ++i) {
      (void)nodes_.socket().send_condition(can::BusCondition::BusOff);
      (void)nodes_.socket().send_condition(can::BusCondition::Active);
    }
  }
  void restart() { nodes_.restart(); }

 private:
  VirtualCan vcan_;
  SteppedTime time_;
  VcanNodes nodes_{vcan_,
                   std::array{can::EncoderIdentity{.node = 1}, can::EncoderIdentity{.node = 2}}};
  std::unique_ptr<drivers::EncoderDevice> device_;
  bool holding_ = false;
  std::vector<can::CanFrame> held_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(EncoderOnVcan, DriverConformance, VcanConformancePeer);

}  // namespace
}  // namespace abbe::tests
