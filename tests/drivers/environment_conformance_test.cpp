// The Modbus driver in the conformance suite: over TCP and over a pseudo terminal.

#include "abbe/drivers/environment/device.hpp"
#include "driver_conformance.hpp"
#include "modbus_peer.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

template <modbus::Transport kTransport>
class FaultyModbus {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 50ms;
  // 50 ms to the next round, then 400 ms
  static constexpr std::chrono::nanoseconds kSilenceLimit = 500ms;
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 1s;  // asked of it
  static constexpr bool kTornCanBeFinished = true;

  static std::set<std::string_view> shown(Fault fault) {
    return {fault == Fault::None ? "reading" : "closed"};
  }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    if (reader_away_ > 0) {
      --reader_away_;
      return;
    }
    std::array<protocol::EnvironmentSample, 16> out{};
    const auto n = device_->samples().pop(out);
    for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
  }
  void serve() { peer_.serve(); }
  void send_valid() {
    if (!holding_) peer_.answer();
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    peer_.answer();
  }
  void send_torn() {
    peer_.serve();
    torn_ = peer_.take_answer();
    ASSERT_FALSE(torn_.empty());
    peer_.send(std::span{torn_}.first(torn_.size() / 2));
  }
  void finish_torn() { peer_.send(std::span{torn_}.subspan(torn_.size() / 2)); }
  void send_garbage() { peer_.send("no answer of any Modbus device"); }
  void unplug() { peer_.unplug(); }
  void plug_in() { peer_.plug_in(); }
  /// Who is only answered when asking cannot be flooded: here the reader does not come.
  void flood() { reader_away_ = 20; }
  void restart() { peer_.hang_up(); }

 private:
  drivers::EnvironmentDeviceOptions options() const {
    drivers::EnvironmentDeviceOptions o;
    o.address = peer_.address();
    o.map = small_map();
    o.map.measured.pop_back();  // one read is one sample
    o.period = kCycle;
    o.answer_timeout = 400ms;
    o.sample_capacity = 4;
    o.raw_capacity_blocks = 4;
    return o;
  }

  SteppedTime time_;
  ModbusPeer peer_{kTransport};
  std::unique_ptr<drivers::EnvironmentDevice> device_ =
      drivers::EnvironmentDevice::create(options(), time_).value();
  bool holding_ = false;
  int reader_away_ = 0;
  ModbusBytes torn_;
};

using ModbusOverTcp = FaultyModbus<modbus::Transport::Tcp>;
using ModbusOverSerial = FaultyModbus<modbus::Transport::Rtu>;
INSTANTIATE_TYPED_TEST_SUITE_P(ModbusTcp, DriverConformance, ModbusOverTcp);
INSTANTIATE_TYPED_TEST_SUITE_P(ModbusRtu, DriverConformance, ModbusOverSerial);

}  // namespace
}  // namespace abbe::tests
