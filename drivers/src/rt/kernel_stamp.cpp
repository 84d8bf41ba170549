#include "abbe/drivers/kernel_stamp.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::drivers {

Arrival KernelStampMap::arrival(std::optional<std::chrono::nanoseconds> stamp, const ClockPair& now,
                                protocol::HostTime host_now) ABBE_RT {
  const bool believed = stamp && believable(now.realtime - *stamp, now);
  const auto since_last = last_ ? now.monotonic - last_->monotonic : options_.u_user_space;
  last_ = now;
  if (!believed) {
    ++widened_;
    // it came after the last receive: where that is less than the wake-up bound, it says more
    return {host_now, std::min(options_.u_user_space, since_last), true};
  }
  const auto age_ns = static_cast<double>((now.realtime - *stamp).count());
  return {host_now - std::chrono::nanoseconds{std::llround(speed_ * age_ns)}, options_.u_kernel, false};
}

bool KernelStampMap::believable(std::chrono::nanoseconds age, const ClockPair& now) const ABBE_RT {
  if (!last_) return false;  // nothing to hold the age against yet
  const auto since_last = now.monotonic - last_->monotonic;
  const auto stepped = (now.realtime - last_->realtime) - since_last;
  return age.count() >= 0 && age <= since_last && std::chrono::abs(stepped) <= options_.step;
}

}  // namespace abbe::drivers
