#pragma once
/// The inner loop: sweeps of coordinate descent over the active columns of one Gram matrix for
/// eight paths at once, one path in each lane of the vector registers. The paths differ in penalty,
/// lambda and active columns; a lane does the same arithmetic in the same order whatever the other
/// lanes hold and however wide the registers are, so its result is the same bits alone or in
/// company, on a processor with AVX-512, AVX2 or neither (multiply and add are never fused).

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace abbe::calib::sparse {

inline constexpr std::size_t kLanes = 8;
/// Columns are swept in blocks of this many; unused ones at the end have a zero Gram row and a zero
/// mask.
inline constexpr std::size_t kBlock = 4;

struct alignas(64) Lanes {
  double of[kLanes]{};
};
struct alignas(64) LaneMask {
  std::int64_t of[kLanes]{};  ///< all bits set: the column is active in this lane; else 0
};

/// How every lane shrinks z to b, and when it is done: |z| <= lambda: 0; <= inner_end: |z| -
/// lambda; <= outer_end:
/// (|z| - offset) * factor; else |z|; times sgn(z).
struct LaneParameters {
  Lanes lambda, inner_end, outer_end, offset, factor;
  Lanes
      /// a sweep whose largest change is smaller ends the lane; -1: an idle lane never ends
      tolerance;
};

struct SweepProblem {
  std::size_t columns = 0;       ///< multiple of kBlock
  const double* gram = nullptr;  ///< columns x columns; row j holds all that z_j needs
  const double* xty = nullptr;
  const LaneMask* mask = nullptr;
  Lanes* b = nullptr;
};

struct SweepOutcome {
  long sweeps = 0;         ///< done
  unsigned converged = 0;  ///< bit of every lane whose last sweep was within its tolerance
};

/// Sweeps until some lane has converged, at most `max_sweeps` (>= 1) times.
using SweepFunction = SweepOutcome (*)(const SweepProblem&, const LaneParameters&, long max_sweeps);

struct SweepVariant {
  std::string_view instructions;  ///< "AVX-512", "AVX2", "baseline"
  SweepFunction sweep = nullptr;
};
/// Those the processor at hand can run, fastest first; the last one runs everywhere.
[[nodiscard]] std::vector<SweepVariant> sweep_variants();

}  // namespace abbe::calib::sparse
