#pragma once
/// The interface of a device to the rest of the project. One cycle of a device is wait(), which may
/// block and allocate, then receive(), which is real-time code. The device thread calls both.
/// Samples leave through the device's own SampleRing, raw bytes through its RawRing.

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

/// State of the model of a device's own clock; see ClockModel. All zero for a device without a
/// clock.
struct ClockStatus {
  bool settled = false;
  double skew = 0.0;                    ///< device clock rate - 1, relative to the host
  std::chrono::nanoseconds residual{};  ///< median lateness of arrivals over the lower envelope
  std::chrono::nanoseconds u_time{};    ///< standard uncertainty of the latest mapping
  std::uint64_t restarts = 0;           ///< times the device clock jumped or restarted
};

/// A copy of the device's status. Counters start at construction and never decrease.
struct DeviceStatus {
  std::string name;
  std::string_view state;  ///< a literal of the driver: "connecting", "streaming", "beam lost", ...
  bool connected = false;  ///< the transport is up and the device has answered
  std::uint64_t samples = 0;      ///< decoded samples, including those dropped
  std::uint64_t dropped = 0;      ///< samples lost because the sample ring was full
  std::uint64_t raw_dropped = 0;  ///< blocks lost because the raw ring was full
  std::uint64_t gaps = 0;         ///< places where the device or the transport lost data
  /// number of faults: incomplete or malformed input, refusals, time-outs, disconnections
  std::uint64_t faults = 0;
  std::uint64_t time_widened = 0;  ///< receives whose kernel stamp could not be used
  ClockStatus clock;
  protocol::HostTime last_sample{};  ///< instant of the latest sample; epoch if none yet
  std::string condition;   ///< present fault: "X missing (node 1)"; empty if there is none
  std::string last_fault;  ///< "what was tried: what was seen"; empty if none yet
  protocol::HostTime last_fault_at{};
};

class Device {
 public:
  Device() = default;
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;
  virtual ~Device() = default;

  /// Device thread, not real-time. Connects, sends what is due, blocks until bytes arrive or
  /// `at_most` (host time) has passed, and reads the bytes into the device's own buffer. Faults are
  /// reported in the status, not thrown. An internal error may throw: see DeviceThread.
  virtual void wait(std::chrono::nanoseconds at_most) = 0;

  /// Device thread, real time. Decodes all bytes that wait() read and puts the samples into the
  /// ring. Does nothing if wait() read no bytes.
  virtual void receive() ABBE_RT = 0;

  /// Any thread, not real-time.
  [[nodiscard]] virtual DeviceStatus status() const = 0;

  /// Device thread, not real-time: called at once after an exception of wait(), before the pause of
  /// the thread. A device that moves a machine stops it here. True: a motion is not known to have
  /// ended, so the thread calls wait() again without its pause. May throw; that counts as true.
  [[nodiscard]] virtual bool stop_after_failure() { return false; }
};

}  // namespace abbe::drivers
