// The counter card driver in the conformance suite, over a real USB/IP connection.

#include "counter_card_peer.hpp"
#include "driver_conformance.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {
namespace {

class FaultyCard {
 public:
  static constexpr std::chrono::nanoseconds kCycle = 1ms;
  static constexpr std::chrono::nanoseconds kSilenceLimit = 100ms;
  // 300 requests, one in two cycles; pauses
  static constexpr std::chrono::nanoseconds kRecoveryLimit = 3s;
  static constexpr bool kTornCanBeFinished = true;

  static std::set<std::string_view> shown(Fault fault) {
    if (fault == Fault::None) return {"streaming"};
    if (fault == Fault::Mute) return {"restarting", "loading", "arming"};
    return {"closed"};
  }

  drivers::Device& device() { return *bench_.device; }
  SteppedTime& time() { return bench_.time; }
  void take_samples(std::vector<protocol::SampleHead>& heads) {
    for (const auto& sample : bench_.take_samples()) heads.push_back(sample.head);
  }
  void serve() {
    server().mute(true);
    server().poll(time().now());
  }
  void send_valid() {
    if (holding_ || torn_ || flood_after_ > time().now()) return;
    server().mute(false);
    server().poll(time().now());
  }
  void hold_back() { holding_ = true; }
  void send_held() { holding_ = false; }
  void send_torn() {
    torn_ = true;
    server().hold_output(true);
    server().mute(false);
    server().poll(time().now());
    server().send_part(280);  // half of a header and 512 bytes
  }
  void finish_torn() {
    server().hold_output(false);
    torn_ = false;
  }
  void send_garbage() {
    const std::vector<std::byte> nonsense(64, std::byte{0xA5});
    server().send_bytes(nonsense);
  }
  void unplug() { server().plug_out(); }
  void plug_in() { server().plug_in(); }
  /// What gathers in the card in 20 ms, at once: 800 scans.
  void flood() { flood_after_ = time().now() + 20ms; }
  void restart() {
    server().disconnect();
    server().card().restart();
  }
  void jump_clock() { server().card().jump_clock(2'000'000); }

 private:
  static drivers::CounterCardOptions options() {
    auto options = CardBench::default_options();
    options.sample_capacity = 256;
    options.raw_capacity_blocks = 64;  // not read here: always full
    return options;
  }
  sim::UsbipServer& server() { return bench_.server; }

  CardBench bench_{options()};
  bool holding_ = false;
  bool torn_ = false;
  protocol::HostTime flood_after_{};
};

INSTANTIATE_TYPED_TEST_SUITE_P(CounterCard, DriverConformance, FaultyCard);

}  // namespace
}  // namespace abbe::tests
