#pragma once
/// The rows that a run along a path will give.

#include <cstddef>

#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::calib::otf {

/// Observations of the run with y = 0: segments as make_segments() forms them at this feed, without
/// those near the ends of a leg. Dwells give no segments.
[[nodiscard]] Result<Observations> planned_observations(const Path&, const PlannedRun&,
                                                        std::size_t row_points);

}  // namespace abbe::calib::otf
