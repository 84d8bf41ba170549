#include "abbe/drivers/kernel_stamp.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::drivers {

Arrival KernelStampMap::arrival(std::optional<std::chrono::nanoseconds> stamp, const ClockPair& now,
                                protocol::HostTime host_now) ABBE_RT {
  if (!stamp || !believable(now.realtime - *stamp, now)) {
    ++widened_;
    // The bytes arrived after the queue was known to be empty, so they are not older than that
    // moment. Their uncertainty is this age, or u_user_space if it is smaller.
    const auto possible = empty_at_ ? now.monotonic - empty_at_->monotonic : options_.u_user_space;
    return {host_now, std::min(options_.u_user_space, possible), true};
  }
  const auto age_ns = static_cast<double>((now.realtime - *stamp).count());
  return {host_now - std::chrono::nanoseconds{std::llround(speed_ * age_ns)}, options_.u_kernel,
          false};
}

bool KernelStampMap::believable(std::chrono::nanoseconds age, const ClockPair& now) const ABBE_RT {
  if (!empty_at_) return false;  // there is no bound of the age yet
  const auto possible = now.monotonic - empty_at_->monotonic;
  const auto stepped = (now.realtime - empty_at_->realtime) - possible;
  return age.count() >= 0 && age <= possible + options_.step &&
         std::chrono::abs(stepped) <= options_.step;
}

}  // namespace abbe::drivers
