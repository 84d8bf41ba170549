// The whole daemon in the guest, all devices at once: with encoders on a virtual CAN bus and a
// measuring machine, with two counter cards and a probe. In virtual time, so that nothing may be
// lost.

#include "abbe/drivers/time_source.hpp"
#include "can_interface.hpp"
#include "counter_card_daemon.hpp"
#include "served_devices.hpp"
#include "simulated_encoders.hpp"

namespace abbe::tests {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class DaemonOnCan : public WholeDaemon {
 protected:
  void start() {
    constexpr const char* kBus = R"(
[encoder]
transport = "socketcan"
interface = "vcan7"
sync = "kernel"
sync_period_us = 1000
nodes = [
  { axis = "X", node = 1, step_nm = 10 },
  { axis = "Y", node = 2, step_nm = 10 },
  { axis = "Z", node = 3, step_nm = 10 },
]
)";
    start_all(
        "", "",
        kBus + fmt::format("[cmm]\nhost = \"127.0.0.1\"\nport = {}\n", measuring_machine_.port()));
  }

  static constexpr double kEncoder_hz = 980.0;  // CAN_BCM makes each period a few us too long
  static constexpr double kMachine_hz = 9.0;    // reports at most 10 a second

  VirtualCan vcan_;
  /// Not those of abbe-sim: while it makes a burst of the tracker, its nodes would answer periods
  /// late.
  SimulatedEncoders encoders_{vcan_, 3, 91};
  sim::IppDmeServer measuring_machine_ = open_measuring_machine(drivers::MonotonicTime{}.now());
  ServedDevices served_{peer_of(measuring_machine_), 90};
};

TEST_F(DaemonOnCan, AcquiresFromAllDevicesWithoutLossAndComesBackAfterTheBusWasDown) {
  ASSERT_NO_FATAL_FAILURE(start());
  ASSERT_NO_FATAL_FAILURE(
      expect_nothing_lost({{"encoder", kEncoder_hz}, kTracker, kAir, {"cmm", kMachine_hz, 1.0}}));
  vcan_.down();
  ASSERT_TRUE(becomes("encoder", "closed"));
  EXPECT_THAT(stream("encoder").value("last_fault", ""), HasSubstr("vcan7"));
  vcan_.up();
  EXPECT_TRUE(becomes("encoder", "streaming"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
}

TEST_F(DaemonOnCan, RecordsWithoutLoss) {
  ASSERT_NO_FATAL_FAILURE(start());
  ASSERT_TRUE(becomes("encoder", "streaming"));
  ASSERT_TRUE(becomes("tracker", "streaming"));
  ::sleep(2);
  const json said = json::parse(replay(recording_of_stopped(), "--json"), nullptr, false);
  ASSERT_TRUE(said.is_object());
  EXPECT_EQ(said["losses"], json::array()) << said.dump(1);
}

TEST_F(CounterCardDaemon, AcquiresFromAllDevicesWithoutLoss) {
  ASSERT_NO_FATAL_FAILURE(expect_nothing_lost_from_all());
}

}  // namespace
}  // namespace abbe::tests
