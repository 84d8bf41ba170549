#pragma once

namespace abbe::sim {

/// The value between `before` and `after` at which `crossed` becomes true, by bisection to the last
/// bit of a double. Precondition: `crossed` is false at `before` and true at `after`.
template <class Crossed>
[[nodiscard]] double crossing(double before, double after, const Crossed& crossed) {
  constexpr int kHalvingsToLastBit = 60;
  for (int i = 0; i < kHalvingsToLastBit; ++i) {
    const double middle = 0.5 * (before + after);
    (crossed(middle) ? after : before) = middle;
  }
  return after;
}

}  // namespace abbe::sim
