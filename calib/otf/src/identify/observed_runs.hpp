#pragma once
/// The observations of several runs with different target offsets, which have common tables, and
/// their normal equations (targets.hpp). Pure functions.

#include <cstddef>
#include <span>
#include <vector>

#include "abbe/calib/internal/otf/observe/aligned_segments.hpp"
#include "abbe/calib/otf/identify/targets.hpp"

namespace abbe::calib::otf {

/// Observations of all runs, and the segments from which they are made (empty in standstill mode).
struct ObservedRuns {
  std::vector<Observations> observations;
  std::vector<SegmentSeries> series;
};

/// Checks the target offsets. NotFinite; DegenerateGeometry if the offsets are on a line.
[[nodiscard]] Result<void> check_targets(std::span<const TargetRun> runs);

/// Computes the observations of all runs. An error of observe() or aligned_segments() names its
/// run.
[[nodiscard]] Result<ObservedRuns> observe_runs(std::span<const TargetRun> runs,
                                                const Machine& machine, const Noise& noise,
                                                const Options& options);

[[nodiscard]] std::size_t rows_of_runs(std::span<const Observations> runs);

/// Information of all rows, without priors.
[[nodiscard]] estimation::Information rows_information(std::span<const Observations> runs);

/// Options of the adjustment of all runs. `runs` must outlive the result.
[[nodiscard]] estimation::DatumOptions datum_options(std::span<const Observations> runs,
                                                     const Options& options);

/// Linearises the runs at their common solution; returns the number of adjustments. NotConverged
/// after `options.max_adjustments`, or if `options.stopped` returns true.
[[nodiscard]] Result<int> linearise_runs(ObservedRuns& runs, const Noise& noise,
                                         const Options& options);

}  // namespace abbe::calib::otf
