#pragma once
/// From the kernel's receive stamp to host time. SO_TIMESTAMPING stamps are wall-clock time, which
/// people and NTP may step, so a stamp serves only as an age, taken against the wall clock of the
/// same moment:
///   age = realtime now - stamp,  arrival = host now - age.
/// Accepted when 0 <= age <= time since the queue was last known to be empty, and when the wall clock went on
/// since then as the monotonic clock did (else one of them was stepped, and the age may be wrong by that
/// step). The bound moves only with nothing_older_than(), so every stamp of one batch is held against the
/// same. A stamp that is not accepted leaves the user-space time, widened, and is counted. A wall-clock step
/// therefore changes no arrival. The kernel begins to stamp a moment after the first socket asked (one of its
/// workers switches it on): what comes before has none. Pure: every time is handed in. One thread.

#include <chrono>
#include <cstdint>
#include <optional>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

/// When bytes came. `u_time` is a standard uncertainty (k = 1).
struct Arrival {
  protocol::HostTime time{};
  std::chrono::nanoseconds u_time{};
  bool widened = false;  ///< the kernel stamp was missing or not believed
};

/// Both clocks, read one right after the other around a receive.
struct ClockPair {
  std::chrono::nanoseconds monotonic{};  ///< CLOCK_MONOTONIC, as the system gives it
  std::chrono::nanoseconds realtime{};   ///< CLOCK_REALTIME
};

/// Reads both clocks at one instant, again if the thread was interrupted in between; ordinary world
/// (vDSO).
[[nodiscard]] ClockPair read_clock_pair() noexcept;

struct KernelStampOptions {
  std::chrono::nanoseconds u_kernel =
      std::chrono::microseconds{10};  ///< interrupt to stamp on an idle shop-floor PC
  /// Waking up the device thread: what an arrival may be late by when only user space saw it.
  std::chrono::nanoseconds u_user_space = std::chrono::milliseconds{1};
  /// Two readings of two clocks with a preemption between them, or a stamp on its way into the
  /// queue; below it a step is not seen and does no harm.
  std::chrono::nanoseconds step = std::chrono::microseconds{200};
};

class KernelStampMap {
 public:
  /// `speed`: host time per monotonic time, as in MonotonicTime.
  explicit KernelStampMap(double speed = 1.0, const KernelStampOptions& options = {}) noexcept
      : speed_(speed), options_(options) {}

  /// `stamp`: the kernel's, wall-clock; none if the socket gave none. `now`: both clocks after the
  /// receive; `host_now`: host time of that moment.
  Arrival arrival(std::optional<std::chrono::nanoseconds> stamp, const ClockPair& now,
                  protocol::HostTime host_now) ABBE_RT;

  /// Both clocks just before a read that left nothing in the queue, or before the socket began to
  /// listen: what is read from now on has not come earlier. Until the first call no stamp is
  /// believed.
  void nothing_older_than(const ClockPair& begun) ABBE_RT { empty_at_ = begun; }

  /// Arrivals whose stamp was missing or not believed; the caller's own thread.
  [[nodiscard]] std::uint64_t widened() const ABBE_RT { return widened_; }

 private:
  [[nodiscard]] bool believable(std::chrono::nanoseconds age, const ClockPair& now) const ABBE_RT;

  double speed_;
  KernelStampOptions options_;
  std::optional<ClockPair> empty_at_;
  std::uint64_t widened_ = 0;
};

}  // namespace abbe::drivers
