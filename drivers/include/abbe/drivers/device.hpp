#pragma once
/// The seam: what the rest of the house knows of a device. The one place with inheritance. One turn
/// of a device is wait(), in the ordinary world, then receive(), in real time; both are called by
/// the one device thread. Samples leave through the device's own SampleRing, raw bytes through its
/// RawRing.

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

/// How well a device's own clock is known; see ClockModel. All zero for a device without a clock.
struct ClockStatus {
  bool settled = false;
  double skew = 0.0;                    ///< device clock rate - 1, relative to the host
  std::chrono::nanoseconds residual{};  ///< median lateness of arrivals over the lower envelope
  std::chrono::nanoseconds u_time{};    ///< standard uncertainty of the latest mapping
  std::uint64_t restarts = 0;           ///< times the device clock jumped or began anew
};

/// A copy, taken at one moment; counters are since construction and never go back.
struct DeviceStatus {
  std::string name;
  std::string_view state;  ///< a literal of the driver: "connecting", "streaming", "beam lost", ...
  bool connected = false;  ///< the transport is up and the device has answered
  std::uint64_t samples = 0;      ///< decoded, whether or not they found room
  std::uint64_t dropped = 0;      ///< samples lost because the sample ring was full
  std::uint64_t raw_dropped = 0;  ///< blocks lost because the raw ring was full
  /// places in the stream where the device or the transport lost something
  std::uint64_t gaps = 0;
  std::uint64_t faults = 0;  ///< torn, garbage, refused, timed out, disconnected: each counts once
  std::uint64_t time_widened = 0;  ///< receives whose kernel stamp could not be used
  ClockStatus clock;
  protocol::HostTime last_sample{};  ///< the instant the latest sample describes; epoch if none yet
  std::string condition;   ///< what is wrong at this moment: "X missing (node 1)"; empty: nothing
  std::string last_fault;  ///< "what was tried: what was seen"; empty if none yet
  protocol::HostTime last_fault_at{};
};

class Device {
 public:
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  virtual ~Device() = default;

  /// Device thread, ordinary world: connect, send what is due, block until bytes come or `at_most`
  /// (host time) has passed, read them into the device's own buffer. Faults are status, not
  /// exceptions; a defect may throw and ends the thread with the cause kept.
  virtual void wait(std::chrono::nanoseconds at_most) = 0;

  /// Device thread, real time: everything wait() read becomes samples in the ring. Nothing read:
  /// nothing happens.
  virtual void receive() ABBE_RT = 0;

  /// Any thread, ordinary world.
  [[nodiscard]] virtual DeviceStatus status() const = 0;
};

}  // namespace abbe::drivers
