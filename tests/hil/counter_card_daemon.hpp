#pragma once
/// The whole daemon with all that can be had at once with counter cards: axes, probe and reference
/// marks of two cards over USB/IP, tracker, air. In the guest or, by scripts/soak, on this
/// computer.

#include "whole_daemon.hpp"

namespace abbe::tests {

class CounterCardDaemon : public WholeDaemon {
 protected:
  void expect_nothing_lost_from_all() {
    ASSERT_NO_FATAL_FAILURE(start_all(kSimulatedProbe, kCards, "[probe]\nmax_speed_mm_s = 100\n"));
    ASSERT_NO_FATAL_FAILURE(
        expect_nothing_lost({{"counter_card", kCard_hz}, {"reference_card", 0.0}, kTracker, kAir}));
    if (!records_raw()) return;
    const std::string lines = replay(recording_of_stopped(), "--samples");
    int touches = 0;
    for (auto at = lines.find("\ntouch "); at != std::string::npos;
         at = lines.find("\ntouch ", at + 1))
      ++touches;
    print_figure("whole daemon, probe", fmt::format("one each {} s", kTouches_s), "{} touches",
                 touches);
    EXPECT_GE(touches, run_seconds() / kTouches_s);
  }

 private:
  static constexpr double kCard_hz = 1000.0;
  static constexpr int kTouches_s = 10;  // the surface is crossed twice a lap of some 15 s
  static constexpr const char* kSimulatedProbe = "[sim.probe]\naxis = \"Z\"\nsurface_mm = -200\n";
  static constexpr const char* kCards = R"(
[counter_card]
transport = "usbip"
port = PORT_OF(usbip_port)
clock_MHz = 1
latch_channel = 6
edge_channel = 7
sample_every = 33
axes = [
  { axis = "X", channel = 0, step_nm = 10 },
  { axis = "Y", channel = 1, step_nm = 10 },
  { axis = "Z", channel = 2, step_nm = 10 },
]
[reference]
transport = "usbip"
port = PORT_OF(usbip_port_2)
clock_MHz = 1
axes = [
  { axis = "X", channel = 0, signal_period_um = 20, increment = 1000, length_mm = 420, zero_mark_mm = -210 },
  { axis = "Y", channel = 1, signal_period_um = 20, increment = 1000, length_mm = 420, zero_mark_mm = -210 },
  { axis = "Z", channel = 2, signal_period_um = 20, increment = 1000, length_mm = 420, zero_mark_mm = -420 },
]
)";
};

}  // namespace abbe::tests
