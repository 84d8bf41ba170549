#include <algorithm>

#include "abbe/drivers/counter_card/latch.hpp"

namespace abbe::drivers {
namespace {

/// Rounding of a reading, counts: both channels count whole periods.
constexpr std::int64_t kRounding = 1;

}  // namespace

void LatchTracker::reset() ABBE_RT {
  // A zeroed counter has no latched count: the first reading other than 0 is an edge.
  last_raw_ = 0;
  offset_.reset();
  if (in_step_) offset_ = Offset{};
  latest_.reset();
}

bool LatchTracker::on_scan(std::uint64_t latch_raw, std::uint64_t clock_raw,
                           std::int64_t clock_count, std::int64_t previous_clock_count) ABBE_RT {
  if (latch_raw == last_raw_) return false;
  last_raw_ = latch_raw;
  // Difference latch count minus clock count. The readings wrap; the known offset determines the
  // multiple of their range that must be added.
  const std::uint64_t base = offset_ ? static_cast<std::uint64_t>(offset_->low) : 0;
  const std::int64_t ahead =
      static_cast<std::int64_t>(base) +
      protocol::quad08::signed_step(base & (protocol::quad08::modulus_of(width_) - 1),
                                    protocol::quad08::upward_step(clock_raw, latch_raw, width_),
                                    width_);
  const std::int64_t since_previous = clock_count - previous_clock_count;
  narrow({ahead - kRounding, ahead + since_previous + kRounding});
  const std::int64_t middle = offset_->low + (offset_->high - offset_->low) / 2;
  latest_ = Latch{clock_count + ahead - middle, (offset_->high - offset_->low + 1) / 2};
  return true;
}

void LatchTracker::narrow(const Offset& seen) ABBE_RT {
  if (!offset_) {
    offset_ = seen;
    return;
  }
  const Offset both{std::max(offset_->low, seen.low), std::min(offset_->high, seen.high)};
  if (both.low > both.high) ++disagreements_;
  offset_ = both.low <= both.high ? both : seen;
}

}  // namespace abbe::drivers
