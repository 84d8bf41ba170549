#pragma once
/// What is known of one touch probe and the way it is approached. Defaults: a hard-wired kinematic
/// probe.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/error.hpp"
#include "abbe/drivers/interpolation.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// From contact to the edge at the counter's input. Every probe and interface (wire, optical,
/// radio) has its own, found by calibration: `id` says which.
struct ProbeDelay {
  std::uint32_t id = 1;
  std::chrono::nanoseconds delay = std::chrono::microseconds{5};
  std::chrono::nanoseconds u_jitter =
      std::chrono::microseconds{1};    ///< deviation from touch to touch
  std::chrono::nanoseconds u_delay{};  ///< of `delay` itself: the same error in every touch
};

struct ProbeApproach {
  double min_speed_m_s = 0.0;
  double max_speed_m_s = 0.010;  ///< 600 mm/min
  /// Largest change of speed within `speed_window`, as a share of it: pre-travel is qualified at
  /// one speed.
  double max_speed_change = 0.10;
  std::chrono::nanoseconds speed_window = std::chrono::milliseconds{5};
};

struct ProbeSwitching {
  /// The signal must stand for so long from its last edge on, else it was vibration.
  std::chrono::nanoseconds confirm = std::chrono::milliseconds{5};
  /// Edges within this of the first are the contacts chattering: the first stands. Later ones,
  /// before `confirm` has passed, say that the first was none.
  std::chrono::nanoseconds chatter = std::chrono::milliseconds{1};
  /// Armed again when no edge came for so long ...
  std::chrono::nanoseconds rearm_quiet = std::chrono::milliseconds{20};
  /// ... and the axes went back from the contact by this much: what comes while retracting is the
  /// release.
  double rearm_retract_m = 50e-6;
};

/// The probe's channels on the counter card.
struct ProbeWiring {
  double clock_hz = 10e6;  ///< of the counted time base
  /// Of the edge counter: it counts an edge once the signal has stood for so long, and that is then
  /// the confirmation. 0: it counts every edge.
  std::chrono::nanoseconds counter_debounce{};
  bool use_latch = true;  ///< false: the latched clock is not wired; edges are placed between scans
  std::chrono::nanoseconds scan_period = std::chrono::microseconds{30};
  std::uint8_t linear_axes = 0b111;  ///< bit i: axis i is in m and counts for the speed
  std::array<double, protocol::kMaxAxes> resolution{};  ///< m or rad per count
};

struct TouchOptions {
  ProbeDelay delay;
  ProbeApproach approach;
  ProbeSwitching switching;
  ProbeWiring wiring;
  std::array<double, protocol::kMaxAxes> max_acceleration = InterpolationOptions{}.max_acceleration;
  /// scans kept, from the contact
  std::chrono::nanoseconds window_before = std::chrono::milliseconds{10};
  std::chrono::nanoseconds window_after = std::chrono::milliseconds{10};
  std::size_t touch_capacity = 256;
  std::size_t window_capacity = 8192;  ///< scans; a window of 20 ms at 33 kHz has 667
};

/// BadConfiguration names the option that is out of its range.
[[nodiscard]] Result<void> check(const TouchOptions& options);

}  // namespace abbe::drivers
