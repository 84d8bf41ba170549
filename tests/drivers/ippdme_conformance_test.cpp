#include "abbe/drivers/ippdme/device.hpp"
#include "driver_conformance.hpp"
#include "ippdme_peer.hpp"

#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

class FaultyMeasuringMachine {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 100ms;  // no server reports more often
  static constexpr std::chrono::nanoseconds kSilenceLimit = 3s;
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 30s;  // two cycles per command
  static constexpr bool kTornCanBeFinished = true;

  static std::set<std::string_view> shown(Fault fault) { return shown_over_tcp(fault, "ready"); }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<protocol::AxisSample, 64> positions{};
    while (const std::size_t n = device_->positions().pop(positions))
      for (std::size_t i = 0; i < n; ++i) heads.push_back(positions[i].head);
    std::array<protocol::ProbeTrigger, 16> touches{};
    while (const std::size_t n = device_->touches().pop(touches))
      for (std::size_t i = 0; i < n; ++i) heads.push_back(touches[i].head);
  }
  void serve() { peer_.serve(time_.now()); }
  void send_valid() {
    if (!holding_) peer_.send_gathered();
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    peer_.send_gathered();
  }
  void send_torn() { peer_.send("E0001 # X(1.5),Y("); }
  void finish_torn() { peer_.send("2.5),Z(3.5)\r\n"); }
  void send_garbage() { peer_.send("220 mail.example.com ESMTP\r\n"); }
  void unplug() { peer_.unplug(); }
  void plug_in() { peer_.listen(); }
  void flood() {
    std::string lines;
    for (int i = 0; i < 600; ++i) lines += "E0001 # X(1),Y(2),Z(3)\r\n";
    peer_.send(lines);
  }
  void restart() { peer_.restart(time_.now()); }

 private:
  drivers::IppDeviceOptions options() const {
    drivers::IppDeviceOptions o;
    o.port = peer_.port();
    o.position_capacity = 64;  // a read holds 170
    return o;
  }

  SteppedTime time_;
  IppDmePeer peer_{time_.now()};
  bool holding_ = false;
  std::unique_ptr<drivers::IppDevice> device_ =
      drivers::IppDevice::create(options(), time_).value();
};

INSTANTIATE_TYPED_TEST_SUITE_P(MeasuringMachine, DriverConformance, FaultyMeasuringMachine);

}  // namespace
}  // namespace abbe::tests
