#include "abbe/drivers/sampling/scan_history.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "abbe/result/try.hpp"

namespace abbe::drivers {

using protocol::AxisSample;
using protocol::DeviceTime;
using protocol::HostTime;
using std::chrono::nanoseconds;

void ScanHistory::push(const CounterScan& scan) ABBE_RT {
  slots_[static_cast<std::size_t>(end_) & mask_] = scan;
  ++end_;
  if (end_ - begin_ > mask_ + 1) ++begin_;
}

void ScanHistory::clear() ABBE_RT {
  begin_ = end_;
}

DeviceTime ScanHistory::instant(std::int64_t clock_count) const ABBE_RT {
  // long double: a day at 10 MHz is 8.6e11 counts or 8.6e13 ns; the precision of a double is not
  // sufficient for the product with the period.
  const auto ns =
      (static_cast<long double>(clock_count) + 0.5L) * 1e9L * static_cast<long double>(period_s_);
  return DeviceTime{nanoseconds{std::llround(ns)}};
}

std::uint64_t ScanHistory::first_after(DeviceTime t) const ABBE_RT {
  std::uint64_t low = begin_;
  for (std::uint64_t high = end_; low < high;) {
    const std::uint64_t middle = low + (high - low) / 2;
    if (instant(scan(middle).clock_count) > t) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

tl::expected<ScanHistory::At, InterpolationError> ScanHistory::at(
    DeviceTime t, const InterpolationOptions& options) const ABBE_RT {
  const std::uint64_t after = first_after(t);
  if (after == begin_) return tl::unexpected(InterpolationError::TooEarly);
  if (after == end_) return tl::unexpected(InterpolationError::TooLate);
  std::array<AxisSample, 4> around;
  std::size_t count = 0;
  const std::uint64_t first = std::max(begin_, after >= 2 ? after - 2 : 0);
  for (std::uint64_t n = first; n < std::min(end_, after + 2); ++n, ++count) {
    around[count] = scan(n).axes;
    around[count].head.time = HostTime{instant(scan(n).clock_count).time_since_epoch()};
    around[count].head.u_time = {};
  }
  const auto axes = interpolate_axes(std::span{around}.first(count), HostTime{t.time_since_epoch()},
                                     nanoseconds{}, options);
  ABBE_TRY(axes);
  const CounterScan& before = scan(after - 1);
  return At{*axes, before.axes.head.time + (t - instant(before.clock_count)),
            before.axes.head.u_time};
}

}  // namespace abbe::drivers
