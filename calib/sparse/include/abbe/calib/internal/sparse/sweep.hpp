#pragma once
/// The inner loop of the sparse solver: sweeps of coordinate descent over the active columns of one
/// Gram matrix for eight paths at once, one path in each lane of the vector registers. The paths
/// differ in penalty, lambda and active columns. The arithmetic of a lane and its order depend
/// neither on the other lanes nor on the width of the registers. The result of a lane therefore has
/// the same bits alone and with other lanes, with AVX-512, AVX2 or neither (multiply and add are
/// never fused).

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace abbe::calib::sparse {

inline constexpr std::size_t kLanes = 8;
/// Number of columns in a block of a sweep. Unused columns of the last block have a zero Gram row
/// and a zero mask.
inline constexpr std::size_t kBlock = 4;

struct alignas(64) Lanes {
  double of[kLanes]{};
};
struct alignas(64) LaneMask {
  std::int64_t of[kLanes]{};  ///< all bits set: the column is active in this lane; else 0
};

/// Parameters of every lane: tolerance of convergence, and the function that shrinks z, the
/// solution without penalty, to the coefficient b with the penalty. b has the sign of z; |b| is
///     |z| <= lambda       0
///     |z| <= inner_end    |z| - lambda
///     |z| <= outer_end    (|z| - offset) * factor
///     else                |z|
struct LaneParameters {
  Lanes lambda, inner_end, outer_end, offset, factor;
  /// A lane has converged when the largest change of b in a sweep is below this value. -1: the lane
  /// is not in use and never converges.
  Lanes tolerance;
};

struct SweepProblem {
  std::size_t columns = 0;       ///< multiple of kBlock
  const double* gram = nullptr;  ///< columns x columns; row j is used to compute z of column j
  const double* xty = nullptr;
  const LaneMask* mask = nullptr;
  Lanes* b = nullptr;
};

struct SweepOutcome {
  long sweeps = 0;         ///< number of sweeps done
  unsigned converged = 0;  ///< bit k is set if lane k has converged
};

/// Sweeps until at least one lane has converged, at most `max_sweeps` (>= 1) times.
using SweepFunction = SweepOutcome (*)(const SweepProblem&, const LaneParameters&, long max_sweeps);

struct SweepVariant {
  std::string_view instructions;  ///< "AVX-512", "AVX2", "baseline"
  SweepFunction sweep = nullptr;
};
/// The variants that this processor can run, fastest first; the last one runs on every processor.
[[nodiscard]] std::vector<SweepVariant> sweep_variants();

}  // namespace abbe::calib::sparse
