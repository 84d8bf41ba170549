#include "abbe/drivers/sampling/mark_traverse.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::drivers {

void MarkTraverse::reset() noexcept {
  count_ = 0;
  refusals_ = 0;
  moving_ = false;
  direction_ = 0;
  reversed_ = false;
}

void MarkTraverse::on_position(std::int64_t count) noexcept {
  follow(static_cast<double>(count) / options_.counts_per_period);
}

/// Updates the direction of travel. It changes only after travel of reversal_periods back from the
/// farthest point, so that noise does not change it.
void MarkTraverse::follow(double position) noexcept {
  if (!moving_) {
    moving_ = true;
    farthest_ = position;
    return;
  }

  const double way = position - farthest_;
  if (direction_ == 0) {
    if (std::abs(way) < options_.reversal_periods) return;
    direction_ = way > 0.0 ? 1 : -1;
    farthest_ = position;
  } else if (way * direction_ >= 0.0) {
    farthest_ = position;
  } else if (std::abs(way) >= options_.reversal_periods) {
    direction_ = -direction_;
    farthest_ = position;
    reversed_ = true;
  }
}

void MarkTraverse::keep(double position) noexcept {
  if (count_ == kMarksForZero) {
    std::copy(marks_.begin() + 1, marks_.end(), marks_.begin());
    --count_;
  }
  marks_[count_++] = position;
}

tl::unexpected<MarkFault> MarkTraverse::refuse(MarkFault fault) noexcept {
  return tl::unexpected(++refusals_ >= options_.most_refusals ? MarkFault::WrongScale : fault);
}

std::optional<tl::expected<MarkZero, MarkFault>> MarkTraverse::on_mark(
    std::int64_t count) noexcept {
  const double position = static_cast<double>(count) / options_.counts_per_period;
  follow(position);
  if (reversed_) {
    reversed_ = false;
    const bool lost = count_ > 0;
    count_ = 0;
    keep(position);
    if (!lost) return std::nullopt;
    return tl::expected<MarkZero, MarkFault>{tl::unexpected(MarkFault::Reversed)};
  }

  keep(position);
  if (count_ < kMarksForZero) return std::nullopt;
  auto zero = zero_of(options_.code, marks_);

  if (!zero) {
    // One of the four marks is wrong, and which one is unknown: keep only the latest, as the first
    // of the next four.
    count_ = 0;
    keep(position);
    return tl::expected<MarkZero, MarkFault>{refuse(zero.error())};
  }

  refusals_ = 0;
  return zero;
}

}  // namespace abbe::drivers
