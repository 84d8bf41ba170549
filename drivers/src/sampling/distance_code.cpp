#include "abbe/drivers/sampling/distance_code.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

namespace abbe::drivers {
namespace {

// The distance of two marks of a scale is a whole number of signal periods. A deviation from a
// whole number by more than this, in periods, is not caused by noise.
constexpr double kMostFraction = 0.25;

tl::unexpected<Error> bad(std::string what) {
  return tl::unexpected(
      Error{ErrorCode::BadConfiguration, "distance-coded marks: " + std::move(what)});
}

int sign(std::int64_t x) noexcept {
  return (x > 0) - (x < 0);
}

std::int64_t on_circle(const DistanceCode& code, std::int64_t position) noexcept {
  if (!code.rotary) return position;
  const std::int64_t rest = position % code.length;
  return rest < 0 ? rest + code.length : rest;
}

/// Number of coded marks on the scale.
std::int64_t coded_marks(const DistanceCode& code) noexcept {
  const std::int64_t k = code.length / code.increment;
  return code.rotary ? k : k + 1;
}

bool on_scale(const DistanceCode& code, std::int64_t position) noexcept {
  return code.rotary || (position >= 0 && position <= code.length);
}

}  // namespace

Result<void> check(const DistanceCode& code) {
  if (code.increment < 8 || code.increment % 2 != 0)
    return bad("the increment must be an even number above 7");
  if (code.length < 2 * code.increment)
    return bad("the scale is shorter than two increments: it has fewer than four marks");
  if (code.rotary && code.length % code.increment != 0)
    return bad("a revolution is not a whole number of increments");
  // On a longer scale the distances of a coded mark to its neighbours would not lie between 0 and
  // the increment.
  if (coded_marks(code) >= code.increment / 2)
    return bad("the scale is longer than its code allows");
  return {};
}

std::string_view name(MarkFault fault) noexcept {
  switch (fault) {
    case MarkFault::NotWhole:
      return "the distance of two marks is not an integer number of periods";
    case MarkFault::NotOfCode:
      return "the scale has no neighbouring marks at this distance";
    case MarkFault::Disagree:
      return "neighbouring marks contradict each other";
    case MarkFault::Reversed:
      return "the direction changed between marks";
    case MarkFault::WrongScale:
      return "repeated marks were refused: this is not the configured scale";
  }

  return "?";
}

std::optional<std::int64_t> first_mark(const DistanceCode& code, std::int64_t distance,
                                       int direction) noexcept {
  const std::int64_t N = code.increment;
  const std::int64_t M = distance;
  const std::int64_t B = 2 * M - N;
  if (M <= 0 || B == 0 || std::abs(B) / 2 > coded_marks(code)) return std::nullopt;
  const std::int64_t P1 = (std::abs(B) - sign(B) - 1) * N / 2 + (sign(B) - direction) * M / 2;
  if (!on_scale(code, P1) || !on_scale(code, P1 + direction * M)) return std::nullopt;
  return on_circle(code, P1);
}

tl::expected<MarkZero, MarkFault> zero_of(const DistanceCode& code,
                                          std::span<const double, kMarksForZero> marks) noexcept {
  MarkZero zero;
  zero.direction = marks[1] > marks[0] ? 1 : -1;
  std::array<std::int64_t, kMarksForZero> position{};
  std::optional<std::int64_t> expected;

  for (std::size_t i = 0; i + 1 < kMarksForZero; ++i) {
    const double apart = (marks[i + 1] - marks[i]) * zero.direction;
    if (apart <= 0.0) return tl::unexpected(MarkFault::Reversed);
    const double whole = std::round(apart);
    if (std::abs(apart - whole) > kMostFraction) return tl::unexpected(MarkFault::NotWhole);
    const auto M = static_cast<std::int64_t>(whole);
    const auto P = first_mark(code, M, zero.direction);
    if (!P) return tl::unexpected(MarkFault::NotOfCode);
    if (expected && on_circle(code, *expected) != *P) return tl::unexpected(MarkFault::Disagree);
    // The position is not reduced modulo the circle, because the offsets of the four marks must be
    // comparable.
    position[i] = expected ? *expected : *P;
    expected = position[i] + zero.direction * M;
  }

  position.back() = *expected;
  zero.first_mark = position[0];
  double low = 0.0;
  double high = 0.0;

  for (std::size_t i = 0; i < kMarksForZero; ++i) {
    const double offset = static_cast<double>(position[i]) - marks[i];
    low = i == 0 ? offset : std::min(low, offset);
    high = i == 0 ? offset : std::max(high, offset);
    zero.offset_periods += offset / static_cast<double>(kMarksForZero);
  }

  zero.spread_periods = high - low;
  return zero;
}

}  // namespace abbe::drivers
