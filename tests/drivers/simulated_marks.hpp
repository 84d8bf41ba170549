#pragma once
/// A scale with distance-coded marks, made from its drawing: fixed marks every N, the k-th coded
/// mark k + 1 beyond the middle. Independent of the decoder.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "abbe/drivers/sampling/distance_code.hpp"

namespace abbe::tests {

/// Positions of all marks in periods, in order. Rotary: of `turns` revolutions, the zero mark again
/// each time.
inline std::vector<std::int64_t> marks_of(const drivers::DistanceCode& code, int turns = 1) {
  std::vector<std::int64_t> marks;
  for (int turn = 0; turn < (code.rotary ? turns : 1); ++turn) {
    const std::int64_t zero = turn * code.length;
    for (std::int64_t k = 0; k * code.increment < code.length; ++k) {
      marks.push_back(zero + k * code.increment);
      marks.push_back(zero + k * code.increment + code.increment / 2 + k + 1);
    }
  }

  if (!code.rotary) {
    while (marks.back() > code.length) marks.pop_back();
  }

  std::sort(marks.begin(), marks.end());
  return marks;
}

}  // namespace abbe::tests
