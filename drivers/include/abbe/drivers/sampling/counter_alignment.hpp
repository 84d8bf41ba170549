#pragma once
/// Relates the counts of two counter cards that count the same scale from different zeros: one card
/// counts live, the other latches at reference marks. The clock that both cards count aligns their
/// scans. At a mark, the live count lies between its values before and after the mark, so every
/// mark bounds the difference of the zeros. The bounds of all marks must intersect. Pure.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>

namespace abbe::drivers {

class CounterAlignment {
 public:
  /// Adds a mark. `latched`: count of the latching card at the mark. `before`, `after`: live counts
  /// of the scans before and after the mark. False: no difference satisfies this and all earlier
  /// marks; one of the cards has miscounted.
  [[nodiscard]] bool add(std::int64_t latched, std::int64_t before, std::int64_t after) noexcept {
    low_ = std::max(low_, latched - std::max(before, after));
    high_ = std::min(high_, latched - std::min(before, after));
    known_ = true;
    return low_ <= high_;
  }
  /// Difference latched count - live count: the middle of the interval in which it must lie;
  /// nullopt before the first mark, and after marks that contradict each other.
  [[nodiscard]] std::optional<double> difference() const noexcept {
    if (!known_ || low_ > high_) return std::nullopt;
    return 0.5 * static_cast<double>(low_) + 0.5 * static_cast<double>(high_);
  }
  /// Half the possible interval: the true difference is difference() +- half_width(), counts.
  [[nodiscard]] double half_width() const noexcept {
    return 0.5 * static_cast<double>(high_) - 0.5 * static_cast<double>(low_);
  }

 private:
  bool known_ = false;
  std::int64_t low_ = std::numeric_limits<std::int64_t>::min() / 2;
  std::int64_t high_ = std::numeric_limits<std::int64_t>::max() / 2;
};

}  // namespace abbe::drivers
