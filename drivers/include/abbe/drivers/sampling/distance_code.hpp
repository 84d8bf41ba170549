#pragma once
/// Distance-coded reference marks: the position of a scale from the distances between neighbouring
/// marks. Pure.
///
/// Positions of the marks, in signal periods from the scale's zero mark, k = 0, 1, ...; N is the
/// distance of two fixed marks:
///     fixed marks  k N
///     coded marks  k N + N / 2 + (k + 1)
/// Two neighbouring marks at the distance M, crossed in the direction D (+1, -1), give the position
/// P1 of the mark crossed first:
///     P1 = (|B| - sgn B - 1) N / 2 + (sgn B - sgn D) |M| / 2,   B = 2 M - N
/// A rotary scale has the same code around a circle of `length` periods; positions are modulo
/// `length`.
///
/// With three marks, an error of one period at one mark can give another valid triple. With four
/// marks, every error of one period at one mark is refused (the tests try all of them).

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
  /// Signal periods of the measuring length (there are no marks beyond it) or, on a rotary scale,
  /// of one revolution.
  std::int64_t length = 50'000;
  bool rotary = false;
};
/// Error BadConfiguration names the impossible value.
[[nodiscard]] Result<void> check(const DistanceCode& code);

enum class MarkFault : std::uint8_t {
  NotWhole,  ///< the distance of two marks is not an integer number of periods: wrong period, noise
  /// The scale has no neighbouring marks at this distance: a mark was missed, or it is another
  /// scale.
  NotOfCode,
  Disagree,    ///< the decodings of neighbouring pairs contradict each other: a miscount
  Reversed,    ///< the direction changed between marks
  WrongScale,  ///< refused repeatedly: this is not the configured scale
};
[[nodiscard]] std::string_view name(MarkFault fault) noexcept;

/// Position of the first of two neighbouring marks, in periods; nullopt if no two neighbours have
/// this distance. `distance` > 0; `direction` of crossing +1 or -1.
[[nodiscard]] std::optional<std::int64_t> first_mark(const DistanceCode& code,
                                                     std::int64_t distance, int direction) noexcept;

inline constexpr std::size_t kMarksForZero = 4;

struct MarkZero {
  std::int64_t first_mark = 0;  ///< position of the first of the four, periods
  int direction = 1;            ///< direction of crossing, +1 or -1
  double offset_periods = 0.0;  ///< scale position = counter + offset, mean of the four
  double spread_periods = 0.0;  ///< largest minus smallest of the four offsets
};

/// The zero that four consecutive marks give. `marks`: counts at the marks, in periods, in the
/// order of crossing; all crossed in the same direction.
[[nodiscard]] tl::expected<MarkZero, MarkFault> zero_of(
    const DistanceCode& code, std::span<const double, kMarksForZero> marks) noexcept;

}  // namespace abbe::drivers
