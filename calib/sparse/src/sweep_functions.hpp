#pragma once
/// One sweep function for each width of the vector registers. sweep_variants() returns the
/// functions that this processor can run.

#include "abbe/calib/internal/sparse/sweep.hpp"

namespace abbe::calib::sparse {

SweepOutcome sweep_baseline(const SweepProblem&, const LaneParameters&, long max_sweeps);
SweepOutcome sweep_avx2(const SweepProblem&, const LaneParameters&, long max_sweeps);
SweepOutcome sweep_avx512(const SweepProblem&, const LaneParameters&, long max_sweeps);

}  // namespace abbe::calib::sparse
