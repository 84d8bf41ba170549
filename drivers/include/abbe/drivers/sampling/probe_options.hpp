#pragma once
/// Properties of one touch probe, its wiring and its approach. Defaults: a hard-wired kinematic
/// probe.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/interpolation.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// Delay from contact to the edge at the counter's input. It is calibrated for every combination of
/// probe and interface (wire, optical, radio); `id` identifies the combination.
struct ProbeDelay {
  std::uint32_t id = 1;
  std::chrono::nanoseconds delay = std::chrono::microseconds{5};
  /// standard deviation between touches
  std::chrono::nanoseconds u_jitter = std::chrono::microseconds{1};
  std::chrono::nanoseconds u_delay{};  ///< standard uncertainty of `delay`: common to all touches
};

struct ProbeApproach {
  double min_speed_m_s = 0.0;
  double max_speed_m_s = 0.010;  ///< 600 mm/min
  /// Largest change of speed within `speed_window`, relative to the speed. The speed must be
  /// constant, because pre-travel is calibrated at one speed.
  double max_speed_change = 0.10;
  std::chrono::nanoseconds speed_window = std::chrono::milliseconds{5};
};

struct ProbeSwitching {
  /// The signal must be stable for this time after its last edge. A signal that is not was caused
  /// by vibration, not by a touch.
  std::chrono::nanoseconds confirm = std::chrono::milliseconds{5};
  /// Edges within this time after the first edge are contact chatter: the first edge stays valid. A
  /// later edge before the end of `confirm` replaces the first edge.
  std::chrono::nanoseconds chatter = std::chrono::milliseconds{1};
  /// The detector is armed again after this time without an edge and after the retraction
  /// rearm_retract_m.
  std::chrono::nanoseconds rearm_quiet = std::chrono::milliseconds{20};
  /// Least distance from the contact before the detector is armed again: edges at a smaller
  /// distance belong to the release of the probe.
  double rearm_retract_m = 50e-6;
};

/// The probe's channels on the counter card.
struct ProbeWiring {
  double clock_hz = 10e6;  ///< frequency of the counted time base
  /// Debounce time of the edge counter: it counts an edge after the signal was stable for this
  /// time, which then replaces `confirm`. 0: it counts every edge.
  std::chrono::nanoseconds counter_debounce{};
  bool use_latch = true;  ///< false: no latch channel; an edge is located to one scan period
  std::chrono::nanoseconds scan_period = std::chrono::microseconds{30};
  std::uint8_t linear_axes = 0b111;  ///< bit i: axis i is in m and contributes to the speed
  std::array<double, protocol::kMaxAxes> resolution{};  ///< m or rad per count
};

struct TouchOptions {
  ProbeDelay delay;
  ProbeApproach approach;
  ProbeSwitching switching;
  ProbeWiring wiring;
  std::array<double, protocol::kMaxAxes> max_acceleration = InterpolationOptions{}.max_acceleration;
  /// The window of a touch: scans are output for this long before and after the contact.
  std::chrono::nanoseconds window_before = std::chrono::milliseconds{10};
  std::chrono::nanoseconds window_after = std::chrono::milliseconds{10};
  std::size_t touch_capacity = 256;
  std::size_t window_capacity = 8192;  ///< scans; a window of 20 ms at 33 kHz has 667
};

/// Error BadConfiguration names the option that is out of its range.
[[nodiscard]] Result<void> check(const TouchOptions& options);

}  // namespace abbe::drivers
