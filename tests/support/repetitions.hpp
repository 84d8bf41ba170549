#pragma once
/// How many random machines, seeds or noise realisations a loop covers. An identification with a
/// sanitizer takes nine times as long, and finds its faults in a few of them. ABBE_FEW_REPETITIONS:
/// a build with sanitizers compiles this test without one.

#include <algorithm>

#include "sanitizers.hpp"

namespace abbe::tests {

#if defined(ABBE_ADDRESS_SANITIZER) || defined(ABBE_THREAD_SANITIZER) ||   \
    defined(ABBE_MEMORY_SANITIZER) || defined(ABBE_UNDEFINED_SANITIZER) || \
    defined(ABBE_FEW_REPETITIONS)
inline constexpr bool kAllRepetitions = false;
#else
/// A statistic whose limits need the full number is asserted only if this is true; what holds in
/// each repetition is asserted always.
inline constexpr bool kAllRepetitions = true;
#endif

/// `all`; in a build with sanitizers the first twentieth of them, at least 2.
template <class Number>
[[nodiscard]] constexpr Number repetitions(Number all) {
  return kAllRepetitions ? all : std::min(all, std::max<Number>(2, all / 20));
}

}  // namespace abbe::tests
