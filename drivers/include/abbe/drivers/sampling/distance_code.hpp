#pragma once
/// Distance-coded reference marks: where a scale stands from the distances between neighbouring
/// marks. Pure.
///
/// Fixed marks lie at k N, coded ones at k N + N / 2 + (k + 1), k = 0, 1, ..., all in signal
/// periods from the scale's zero mark. Two neighbours at the distance M, crossed in the direction D
/// (+1, -1), give with B = 2 M - N the position of the first one crossed:
///     P1 = (|B| - sgn B - 1) N / 2 + (sgn B - sgn D) |M| / 2
/// A rotary scale has the same code around a circle of `length` periods; positions are modulo that.
///
/// One wrong period at one of three marks can give another legal triple. Four do not: every single
/// one-period error at any mark of any four neighbours is refused (the tests try them all).

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

struct DistanceCode {
  std::int64_t increment = 1000;  ///< N: signal periods between two fixed marks; even
  /// Signal periods: of the measuring length (marks beyond it do not exist), or of one revolution.
  std::int64_t length = 50'000;
  bool rotary = false;
};
/// BadConfiguration says what cannot be.
[[nodiscard]] Result<void> check(const DistanceCode& code);

enum class MarkFault : std::uint8_t {
  NotWhole,  ///< the distance of two marks is no whole number of periods: wrong period, or noise
  /// two neighbours at a distance that the scale does not have: a mark was missed, a wrong scale
  NotOfCode,
  Disagree,    ///< the decodings of neighbouring pairs contradict each other: a miscount
  Reversed,    ///< the direction changed between marks
  WrongScale,  ///< mark after mark was refused: this is not the scale that is configured
};
[[nodiscard]] std::string_view name(MarkFault fault) noexcept;

/// Position of the first of two neighbours, in periods; nothing if no two neighbours are so far
/// apart. `distance` > 0; `direction` of crossing +1 or -1.
[[nodiscard]] std::optional<std::int64_t> first_mark(const DistanceCode& code,
                                                     std::int64_t distance, int direction) noexcept;

inline constexpr std::size_t kMarksForDatum = 4;

struct MarkDatum {
  std::int64_t first_mark = 0;  ///< position of the first of the four, periods
  int direction = 1;            ///< in which they were crossed
  double offset_periods = 0.0;  ///< scale position = counter + offset, mean of the four
  double spread_periods = 0.0;  ///< largest less smallest of the four offsets
};

/// `marks`: the counter at four consecutive marks, in periods, in the order of crossing, which is
/// in one direction.
[[nodiscard]] tl::expected<MarkDatum, MarkFault> datum_of(
    const DistanceCode& code, std::span<const double, kMarksForDatum> marks) noexcept;

}  // namespace abbe::drivers
