#include "abbe/drivers/lines/device.hpp"
#include "driver_conformance.hpp"
#include "line_peer.hpp"

#include <type_traits>

#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;
using line_sender::SenderWire;

drivers::lines::LineFormat format_of(std::type_identity<drivers::LinePoints>) {
  return line_sender::time_x_y_z_status();
}
drivers::lines::ValueFormat format_of(std::type_identity<drivers::LineAxes>) {
  return line_sender::time_axes_status();
}

template <class Content, SenderWire::Kind kKind>
class FaultyLineSender {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 200ms;
  static constexpr std::chrono::nanoseconds kSilenceLimit = 1500ms;
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 20s;
  static constexpr bool kStream = kKind != SenderWire::Kind::Udp;
  static constexpr bool kTornCanBeFinished = kStream;

  /// Datagrams come or do not: there is no connection that could be lost.
  static std::set<std::string_view> shown(Fault fault) {
    switch (fault) {
      case Fault::None:
        return {"streaming"};
      case Fault::Garbage:
        return {"streaming", "unreadable lines"};
      case Fault::Mute:
        return {"faulted"};
      case Fault::Unplugged:
        return {kStream ? "disconnected" : "faulted", "waiting for the sender"};
      case Fault::Restart:
        return {kStream ? "disconnected" : "streaming", "waiting for the sender"};
    }
    return {};
  }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<typename Content::Sample, 256> out{};
    while (const std::size_t n = device_->samples().pop(out)) {
      for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
    }
  }
  void serve() { wire_.serve(); }
  /// What was measured while no receiver was connected is not sent later.
  void send_valid() {
    const auto text = points_.until(time_.now());
    if (holding_)
      held_ = text;
    else
      wire_.send(text);
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    wire_.send(held_);
  }
  void send_torn() {
    points_.skip_to(time_.now());
    const auto line = points_.next();
    const std::size_t half = line.size() / 2;
    wire_.send(line.substr(0, half));
    torn_ = line.substr(half);
  }
  void finish_torn() { wire_.send(torn_); }
  void send_garbage() { wire_.send("no line 1 of any tracker\n\x01\xff\n"); }
  void unplug() { wire_.unplug(); }
  void plug_in() {
    points_.skip_to(time_.now());
    wire_.plug_in();
  }
  void flood() {
    std::string text;
    for (int i = 0; i < kFlood; ++i) text += points_.next(1us);
    wire_.send(text);
  }
  void restart() {
    points_.power_on(time_.now());
    wire_.hang_up();
  }
  void jump_clock() { points_.jump(30s); }

 private:
  /// More than the ring holds, and less than the kernel keeps for a serial line (4 kB).
  static constexpr bool kSerial = kKind == SenderWire::Kind::Serial;
  static constexpr int kFlood = kSerial ? 90 : 1800;

  drivers::LineDeviceOptions<Content> options() const {
    drivers::LineDeviceOptions<Content> o;
    o.address = wire_.address();
    o.receiver.format = format_of(std::type_identity<Content>{});
    o.receiver.time_separation = line_sender::PrintedPoints::kSeparation;
    o.sample_capacity = kSerial ? 64 : 1024;
    return o;
  }

  SteppedTime time_;
  SenderWire wire_{kKind};
  line_sender::PrintedPoints points_{time_.now()};
  bool holding_ = false;
  std::string held_, torn_;
  std::unique_ptr<drivers::LineDevice<Content>> device_ =
      drivers::LineDevice<Content>::create(options(), time_).value();
};

template <SenderWire::Kind kKind>
using Points = FaultyLineSender<drivers::LinePoints, kKind>;
template <SenderWire::Kind kKind>
using AxisPositions = FaultyLineSender<drivers::LineAxes, kKind>;

using OverTcp = Points<SenderWire::Kind::Tcp>;
using AsTcpServer = Points<SenderWire::Kind::TcpServer>;
using OverUdp = Points<SenderWire::Kind::Udp>;
using OverSerial = Points<SenderWire::Kind::Serial>;
INSTANTIATE_TYPED_TEST_SUITE_P(LinesTcp, DriverConformance, OverTcp);
INSTANTIATE_TYPED_TEST_SUITE_P(LinesTcpServer, DriverConformance, AsTcpServer);
INSTANTIATE_TYPED_TEST_SUITE_P(LinesUdp, DriverConformance, OverUdp);
INSTANTIATE_TYPED_TEST_SUITE_P(LinesSerial, DriverConformance, OverSerial);

using AxesOverTcp = AxisPositions<SenderWire::Kind::Tcp>;
using AxesOverUdp = AxisPositions<SenderWire::Kind::Udp>;
using AxesOverSerial = AxisPositions<SenderWire::Kind::Serial>;
INSTANTIATE_TYPED_TEST_SUITE_P(AxisLinesTcp, DriverConformance, AxesOverTcp);
INSTANTIATE_TYPED_TEST_SUITE_P(AxisLinesUdp, DriverConformance, AxesOverUdp);
INSTANTIATE_TYPED_TEST_SUITE_P(AxisLinesSerial, DriverConformance, AxesOverSerial);

}  // namespace
}  // namespace abbe::tests
