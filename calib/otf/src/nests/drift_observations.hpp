#pragma once
/// Adds the visits of reference nests to the observations of a run.

#include "abbe/calib/otf/observe/observe.hpp"
#include "observe/run_times.hpp"

namespace abbe::calib::otf {

/// Adds Observations::drift to a run if a nest was visited at least twice, and notes. The rotation
/// of the tracker is estimated, too, if three such nests are not on a line: the height of their
/// triangle is more than a tenth of its longest side. There are two knots for each visit of the
/// nest with the most visits, 32 to 64 in total. A visit within 3 mm of the path is not used,
/// because it is the machine's target that stood there.
[[nodiscard]] Observations with_nest_visits(Observations, const NestVisits&, const RunTimes&,
                                            const NestOptions&);

}  // namespace abbe::calib::otf
