#include "abbe/drivers/tracker/device.hpp"
#include "driver_conformance.hpp"
#include "tracker_peer.hpp"

#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

using namespace std::chrono_literals;

class FaultyTracker {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 200ms;  // bursts come every 324 to 344 ms
  static constexpr std::chrono::nanoseconds kSilenceLimit = 1500ms;
  // a pause, set-up 6 s, Initialize 2 s
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 40s;
  static constexpr bool kTornCanBeFinished = true;

  static std::set<std::string_view> shown(Fault fault) {
    return shown_over_tcp(fault, "streaming");
  }

  drivers::Device& device() { return *device_; }
  SteppedTime& time() { return time_; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    std::array<protocol::TrackerPoint, 256> out{};
    while (const std::size_t n = device_->points().pop(out)) {
      for (std::size_t i = 0; i < n; ++i) heads.push_back(out[i].head);
    }
  }
  void serve() { peer_.serve(time_.now()); }
  void send_valid() {
    if (!holding_) peer_.send_points();
  }
  void hold_back() { holding_ = true; }
  void send_held() {
    holding_ = false;
    peer_.forget_all_but_the_latest();
    peer_.send_points();
  }
  void send_torn() { peer_.send_torn(); }
  void finish_torn() { peer_.finish_torn(); }
  void send_garbage() { peer_.send("no packet of any tracker"); }
  void unplug() { peer_.unplug(); }
  void plug_in() { peer_.listen(); }
  void flood() { peer_.flood(1800); }
  void restart() { peer_.restart(time_.now()); }
  void jump_clock() { peer_.jump_clock(std::chrono::seconds{30}); }

 private:
  drivers::TrackerDeviceOptions options() const {
    drivers::TrackerDeviceOptions o;
    o.host = "127.0.0.1";
    o.port = peer_.port();
    o.point_capacity = 1024;  // six bursts
    return o;
  }

  SteppedTime time_;
  tracker::TrackerPeer peer_{time_.now()};
  bool holding_ = false;
  std::unique_ptr<drivers::TrackerDevice> device_ =
      drivers::TrackerDevice::create(options(), time_).value();
};

INSTANTIATE_TYPED_TEST_SUITE_P(Tracker, DriverConformance, FaultyTracker);

}  // namespace
}  // namespace abbe::tests
