// The encoder device on a bus that echoes its SYNC, as SocketCAN does; the kernel's own is tested
// in the guest.

#include <gmock/gmock.h>

#include <utility>

#include "abbe/protocol/can/error_frame.hpp"
#include "encoder_device_on_udp.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using protocol::AxisSample;
using testing::Each;
using testing::Field;
using testing::HasSubstr;

constexpr auto kOnTheWire = 55us;  // a frame without data at 1 Mbit/s

/// UDP with an echo for every SYNC that leaves, and a transmit queue that can be stopped.
class EchoingBus final : public CanBus {
 public:
  EchoingBus(const UdpCanOptions& options, const TimeSource& time)
      : udp_(options, time), time_(time) {}

  void stop() { stopped_ = true; }
  void go_on() {
    stopped_ = false;
    ASSERT_TRUE(send(std::exchange(queue_, {})).has_value());
  }
  void drop_queue() { queue_.clear(); }  ///< as a controller does that goes off
  [[nodiscard]] std::size_t queued() const { return queue_.size(); }

  Result<void> open(std::span<const std::uint32_t> ids) override { return udp_.open(ids); }
  void close() noexcept override { udp_.close(); }
  Result<CanRead> read(std::span<ReceivedFrame> out, std::chrono::nanoseconds wall) override {
    std::ranges::copy(echoes_, out.begin());
    const auto n = std::exchange(echoes_, {}).size();
    return udp_.read(out.subspan(n), wall).map([n](CanRead more) {
      more.frames += n;
      return more;
    });
  }
  Result<void> send(std::span<const can::CanFrame> frames) override {
    if (stopped_) {
      queue_.insert(queue_.end(), frames.begin(), frames.end());
      return {};
    }
    for (const auto& frame : frames) {
      if (can::decode_sync(frame))
        echoes_.push_back({.frame = frame, .time = time_.now() + kOnTheWire, .echo = true});
    }
    return udp_.send(frames);
  }
  [[nodiscard]] bool echoes_sync() const noexcept override { return true; }
  [[nodiscard]] CanBusCounters counters() const noexcept override { return udp_.counters(); }
  [[nodiscard]] std::string name() const override { return "echoing " + udp_.name(); }

 private:
  UdpCanBus udp_;
  const TimeSource& time_;
  bool stopped_ = false;
  std::vector<can::CanFrame> queue_;
  std::vector<ReceivedFrame> echoes_;
};

class EncoderDeviceWithEcho : public EncoderDeviceOnUdp {
 protected:
  std::unique_ptr<CanBus> make_bus() override {
    auto made = std::make_unique<EchoingBus>(udp(), time);
    echoing = made.get();
    return made;
  }

  EchoingBus* echoing = nullptr;  ///< the device's
};

TEST_F(EncoderDeviceWithEcho, DatesASampleByTheEcho) {
  begin_streaming();
  const auto syncs = peer.syncs();
  turns(40);
  ASSERT_GE(samples.size() + 1, peer.syncs() - syncs);
  EXPECT_THAT(samples, Each(Field(&AxisSample::missing_mask, 0)));
  for (const auto& sample : samples)
    EXPECT_EQ(sample.head.time.time_since_epoch() % kCycle, kOnTheWire) << "sent at whole turns";
  EXPECT_EQ(device->status().faults, 0u);
}

TEST_F(EncoderDeviceWithEcho, MarksASyncThatIsNotSentAndDelaysTheNext) {
  begin_streaming();
  echoing->stop();
  turns(8);
  ASSERT_FALSE(samples.empty());
  EXPECT_EQ(samples.back().missing_mask, 0b11);
  turns(40);
  EXPECT_EQ(echoing->queued(), 1u);
  EXPECT_THAT(device->status().last_fault, HasSubstr("SYNCs not sent"));

  samples.clear();
  echoing->go_on();
  turns(40);
  ASSERT_GT(samples.size(), 5u);
  EXPECT_THAT(samples, Each(Field(&AxisSample::missing_mask, 0)))
      << "the late answers went to nobody";
  EXPECT_GT(samples.front().head.lost_before, 5u);
}

TEST_F(EncoderDeviceWithEcho, StreamsAgainAfterABusOffWithASyncUnderWay) {
  begin_streaming();
  echoing->stop();
  turns(8);
  peer.send(std::array{can::encode_error_frame(
      {.conditions = static_cast<can::BusConditions>(can::BusCondition::BusOff)})});

  ASSERT_TRUE(state_becomes("bus off"));
  echoing->drop_queue();
  echoing->go_on();
  ASSERT_TRUE(state_becomes("streaming"));
  samples.clear();
  turns(20);
  ASSERT_FALSE(samples.empty());
  EXPECT_EQ(samples.back().missing_mask, 0);
}

TEST_F(EncoderDeviceWithEcho, ReplaysItsRawBytesToTheSameSamples) {
  begin_streaming();
  turns(20);
  echoing->stop();
  turns(30);
  echoing->go_on();
  turns(50);
  expect_the_same_from_raw_bytes(
      static_cast<protocol::SampleFlags>(protocol::SampleFlag::TimeWidened));
}

}  // namespace
}  // namespace abbe::drivers
