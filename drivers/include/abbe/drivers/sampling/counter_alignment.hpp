#pragma once
/// Two cards count the same scale from different zeros: one live, one latched at reference marks.
/// Their scans are put beside each other by the clock that both count; at a mark, the live counter
/// was somewhere between its values before and after. Every mark narrows the difference of the
/// zeros; none may contradict. Pure.

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>

namespace abbe::drivers {

class CounterAlignment {
 public:
  /// `latched`: counter of the latching card at the mark. `before`, `after`: live counter at the
  /// scans around it. False: no difference satisfies this and all earlier marks, one of the cards
  /// miscounted.
  [[nodiscard]] bool add(std::int64_t latched, std::int64_t before, std::int64_t after) noexcept {
    low_ = std::max(low_, latched - std::max(before, after));
    high_ = std::min(high_, latched - std::min(before, after));
    known_ = true;
    return low_ <= high_;
  }
  /// latched - live; nothing before the first mark or after a contradiction. The middle of what is
  /// possible.
  [[nodiscard]] std::optional<double> difference() const noexcept {
    if (!known_ || low_ > high_) return std::nullopt;
    return 0.5 * static_cast<double>(low_) + 0.5 * static_cast<double>(high_);
  }
  /// The true difference lies within this of difference(), counts.
  [[nodiscard]] double half_width() const noexcept {
    return 0.5 * static_cast<double>(high_) - 0.5 * static_cast<double>(low_);
  }

 private:
  bool known_ = false;
  std::int64_t low_ = std::numeric_limits<std::int64_t>::min() / 2;
  std::int64_t high_ = std::numeric_limits<std::int64_t>::max() / 2;
};

}  // namespace abbe::drivers
