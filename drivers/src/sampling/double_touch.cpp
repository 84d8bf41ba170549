#include "abbe/drivers/sampling/double_touch.hpp"

#include <algorithm>
#include <cmath>

namespace abbe::drivers {
namespace {

using protocol::ProbeTrigger;
using protocol::TouchFlag;

// Cosine of 10 degrees: approaches within this angle have the same direction.
constexpr double kSameSide = 0.985;

bool usable(const ProbeTrigger& touch) noexcept {
  constexpr protocol::TouchFlags kNotUsable = TouchFlag::SpeedTooLow | TouchFlag::SpeedTooHigh |
                                              TouchFlag::SpeedUnsteady | TouchFlag::NoPosition |
                                              TouchFlag::Refused;
  return (touch.touch_flags & kNotUsable) == 0 && touch.missing_mask == 0 && touch.axis_count > 0;
}

double square(double x) noexcept {
  return x * x;
}

}  // namespace

std::string_view name(TouchRejection rejection) noexcept {
  switch (rejection) {
    case TouchRejection::NotUsable:
      return "a touch is not usable";
    case TouchRejection::NoFastTouch:
      return "no fast touch before the slow one";
    case TouchRejection::OtherPlace:
      return "slow touch far from the fast one";
    case TouchRejection::OtherSide:
      return "slow touches from different directions";
    case TouchRejection::Disagree:
      return "the slow touches do not agree";
  }

  return "?";
}

void DoubleTouch::reset() noexcept {
  found_ = false;
  count_ = 0;
}

DoubleTouch::Outcome DoubleTouch::reject(TouchRejection why) noexcept {
  reset();
  return tl::expected<MeasuredTouch, TouchRejection>{tl::unexpected(why)};
}

double DoubleTouch::distance_m(const ProbeTrigger& a, const ProbeTrigger& b) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.axis_count; ++i)
    if (((rules_.linear_axes >> i) & 1u) != 0) sum += square(a.position[i] - b.position[i]);
  return std::sqrt(sum);
}

double DoubleTouch::cosine(const ProbeTrigger& a, const ProbeTrigger& b) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.axis_count; ++i)
    if (((rules_.linear_axes >> i) & 1u) != 0) sum += a.velocity[i] * b.velocity[i];
  return sum / (a.speed_m_s * b.speed_m_s);
}

DoubleTouch::Outcome DoubleTouch::on_touch(const ProbeTrigger& touch) noexcept {
  if (touch.speed_m_s > rules_.fast_above_m_s) {
    // Only the position of a fast touch is used: its speed may be out of the measuring range.
    if (has(touch.touch_flags, TouchFlag::NoPosition)) return reject(TouchRejection::NotUsable);
    reset();
    found_ = true;
    find_ = touch;
    return std::nullopt;
  }

  if (!found_) return reject(TouchRejection::NoFastTouch);
  if (!usable(touch)) return reject(TouchRejection::NotUsable);
  if (!(distance_m(touch, find_) <= rules_.same_place_m)) return reject(TouchRejection::OtherPlace);
  if (count_ > 0 && !(cosine(touch, slow_[0]) >= kSameSide))
    return reject(TouchRejection::OtherSide);
  slow_[count_++] = touch;
  if (count_ < std::clamp<std::size_t>(rules_.slow_touches, 2, kMostTouches)) return std::nullopt;
  const auto outcome = conclude();
  reset();

  return outcome;
}

double DoubleTouch::along_m(const ProbeTrigger& touch) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < touch.axis_count; ++i)
    if (((rules_.linear_axes >> i) & 1u) != 0) sum += touch.position[i] * slow_[0].velocity[i];
  return sum / slow_[0].speed_m_s;
}

double DoubleTouch::u_along_m(const ProbeTrigger& touch) const noexcept {
  double variance = square(rules_.u_repeatability_m);
  for (std::size_t i = 0; i < touch.axis_count; ++i) {
    if (((rules_.linear_axes >> i) & 1u) == 0) continue;
    variance += square(touch.u_position[i] * slow_[0].velocity[i] / slow_[0].speed_m_s);
  }
  return std::sqrt(variance);
}

double DoubleTouch::u_of_mean(std::size_t axis, double mean) const noexcept {
  const auto n = static_cast<double>(count_);
  double scatter = 0.0;
  double stated = 0.0;
  double shared = 0.0;
  const bool linear = ((rules_.linear_axes >> axis) & 1u) != 0;
  const double u_delay_s = 1e-9 * static_cast<double>(rules_.u_delay.count());

  for (std::size_t k = 0; k < count_; ++k) {
    const ProbeTrigger& t = slow_[k];
    const double u_shared = t.velocity[axis] * u_delay_s;
    const double share = linear ? t.velocity[axis] / t.speed_m_s : 0.0;
    scatter += square(t.position[axis] - mean) / (n - 1.0);
    stated += (std::max(0.0, square(t.u_position[axis]) - square(u_shared)) +
               square(share * rules_.u_repeatability_m)) /
              n;
    shared += square(u_shared) / n;
  }

  return std::sqrt(std::max(scatter, stated) / n + shared);
}

tl::expected<MeasuredTouch, TouchRejection> DoubleTouch::conclude() const noexcept {
  const ProbeTrigger& last = slow_[count_ - 1];
  MeasuredTouch m{
      .touch = last.touch, .probe = last.probe, .touches = count_, .time = last.head.time};
  m.axis_count = last.axis_count;
  double low = along_m(slow_[0]);
  double high = low;
  double u_m = 0.0;

  for (std::size_t k = 0; k < count_; ++k) {
    low = std::min(low, along_m(slow_[k]));
    high = std::max(high, along_m(slow_[k]));
    u_m = std::max(u_m, u_along_m(slow_[k]));
    m.speed_m_s += slow_[k].speed_m_s / static_cast<double>(count_);
  }

  m.spread_m = high - low;
  if (!(m.spread_m <= rules_.agree_sigmas * std::sqrt(2.0) * u_m))
    return tl::unexpected(TouchRejection::Disagree);

  for (std::size_t i = 0; i < m.axis_count; ++i) {
    for (std::size_t k = 0; k < count_; ++k) {
      m.position[i] += slow_[k].position[i] / static_cast<double>(count_);
      m.velocity[i] += slow_[k].velocity[i] / static_cast<double>(count_);
    }
    m.u_position[i] = u_of_mean(i, m.position[i]);
  }

  return m;
}

}  // namespace abbe::drivers
