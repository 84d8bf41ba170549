#pragma once
/// Tells before the machine moves whether a run along a path determines the model. Feed, noise and
/// place of the tracker are not needed: they change weights, but not the rank. With backlash only
/// the legs are used on which the direction of travel of all axes is known (backlash.hpp). A
/// difference between the directions that the path does not determine is not an error: the
/// adjustment has a prior for it, and its notes name it. Pure.

#include <cstddef>
#include <string>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

struct Observability {
  /// Errors that the path leaves undetermined in datum G2, such as "EXX", "EC0Y". Empty: the path
  /// is sufficient.
  std::vector<std::string> undetermined;
  std::size_t rank = 0;    ///< rank of the data of the evaluated legs
  std::size_t needed = 0;  ///< number of unknowns minus number of datum conditions
  std::string unused;      ///< legs that are not used because of backlash: note_on_unused()
};

/// Computes the rank of the data of the legs: points 8.3 mm apart, without those near the ends of a
/// leg (Options::corner_m), two directions across the leg. Legs are evaluated in groups until the
/// rank is sufficient. check(Path, MachineNodes) must accept the path. BadInput for a machine
/// without a layout; RankDeficient if an axis does not move and backlash is estimated.
[[nodiscard]] Result<Observability> observability(
    const Path&, const Machine&, TravelDependence backlash = TravelDependence::None);

/// Returns RankDeficient if the path leaves errors undetermined. The text names them, the parts of
/// the travel that the path does not reach, and the legs that are not used because of backlash.
[[nodiscard]] Result<void> check_observable(const Path&, const Machine&,
                                            TravelDependence backlash = TravelDependence::None);

}  // namespace abbe::calib::otf
