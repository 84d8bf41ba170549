#pragma once
/// Converts the kernel's receive time stamp to host time. SO_TIMESTAMPING stamps are wall-clock
/// time, which an operator or NTP may step. So a stamp is used only as an age, relative to the wall
/// clock at the same moment:
///   age = realtime now - stamp,  arrival = host now - age.
/// A stamp is accepted on two conditions:
///   0 <= age <= time since the receive queue was last known to be empty,
///   since then the wall clock has advanced by the same amount as the monotonic clock.
/// Otherwise one of the clocks was stepped, and the age may be wrong by that step.
/// nothing_older_than() sets the moment at which the queue was empty; no other call moves it, so
/// all stamps of one batch are checked against the same moment. If a stamp is rejected, the
/// user-space time with a larger uncertainty is used, and the event is counted. A wall-clock step
/// therefore changes no arrival.
/// The kernel starts stamping shortly after the first socket requests it (a kernel worker switches
/// it on): packets before that have no stamp. This class reads no clock: every time is an argument.
/// One thread.

#include <chrono>
#include <cstdint>
#include <optional>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

/// The time at which bytes arrived. `u_time` is a standard uncertainty (k = 1).
struct Arrival {
  protocol::HostTime time{};
  std::chrono::nanoseconds u_time{};
  bool widened = false;  ///< larger u_time: the kernel stamp was missing or rejected
};

/// Readings of both clocks, taken one right after the other, just before or after a receive.
struct ClockPair {
  std::chrono::nanoseconds monotonic{};  ///< CLOCK_MONOTONIC, as the system gives it
  std::chrono::nanoseconds realtime{};   ///< CLOCK_REALTIME
};

/// Reads both clocks together; repeats the reading if the thread was interrupted in between. Not
/// real-time (vDSO).
[[nodiscard]] ClockPair read_clock_pair() noexcept;

struct KernelStampOptions {
  /// Standard uncertainty of the delay from the interrupt to the stamp, on an idle shop-floor PC.
  std::chrono::nanoseconds u_kernel = std::chrono::microseconds{10};
  /// Standard uncertainty of the delay until the device thread wakes up; applies if only the
  /// user-space time is known.
  std::chrono::nanoseconds u_user_space = std::chrono::milliseconds{1};
  /// Smallest step of a clock that is detected. Smaller differences between the clocks also arise
  /// from a preemption between the two readings and from the time between stamp and queue; an
  /// undetected smaller step is negligible.
  std::chrono::nanoseconds step = std::chrono::microseconds{200};
};

class KernelStampMap {
 public:
  /// `speed`: host time per monotonic time, as in MonotonicTime.
  explicit KernelStampMap(double speed = 1.0, const KernelStampOptions& options = {}) noexcept
      : speed_(speed), options_(options) {}

  /// `stamp`: wall-clock stamp of the kernel, nullopt if the socket gave none. `now`: both clocks
  /// after the receive; `host_now`: host time at that moment.
  Arrival arrival(std::optional<std::chrono::nanoseconds> stamp, const ClockPair& now,
                  protocol::HostTime host_now) ABBE_RT;

  /// The receive queue was empty at `begun`: both clocks read just before a read that emptied the
  /// queue, or before the socket was opened. Bytes that are read later did not arrive before
  /// `begun`. Before the first call every stamp is rejected.
  void nothing_older_than(const ClockPair& begun) ABBE_RT { empty_at_ = begun; }

  /// Number of arrivals whose stamp was missing or rejected. Same thread as arrival().
  [[nodiscard]] std::uint64_t widened() const ABBE_RT { return widened_; }

 private:
  [[nodiscard]] bool believable(std::chrono::nanoseconds age, const ClockPair& now) const ABBE_RT;

  double speed_;
  KernelStampOptions options_;
  std::optional<ClockPair> empty_at_;
  std::uint64_t widened_ = 0;
};

}  // namespace abbe::drivers
