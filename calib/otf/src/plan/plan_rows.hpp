#pragma once
/// Rows of a run that is only planned.

#include <cstddef>

#include "abbe/calib/otf/observe/observe.hpp"
#include "abbe/calib/otf/plan/plan_prediction.hpp"

namespace abbe::calib::otf {

/// The observations that a run along a path will have, with y = 0. Segments are formed as by
/// make_segments() at this feed, without those near the ends of a leg. Dwells give no segments.
[[nodiscard]] Result<Observations> planned_observations(const Path&, const PlannedRun&,
                                                        std::size_t row_points);

}  // namespace abbe::calib::otf
