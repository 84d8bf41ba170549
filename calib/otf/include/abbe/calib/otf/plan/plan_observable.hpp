#pragma once
/// Whether a run along a path determines the model, judged before the machine moves. Feed, noise
/// and place of the tracker are of no importance: they change weights, not the rank. With backlash
/// only the legs count on which the direction of travel of all axes is known (backlash.hpp). A
/// difference between the directions that the path does not determine is no error: it has its
/// prior, in the adjustment, too, and the notes of the adjustment name it. Pure.

#include <cstddef>
#include <string>
#include <vector>

#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

struct Observability {
  /// Errors that the path leaves undetermined in datum G2: "EXX", "EC0Y". Empty: the path is
  /// sufficient.
  std::vector<std::string> undetermined;
  std::size_t rank = 0;    ///< of the legs that were evaluated
  std::size_t needed = 0;  ///< unknowns less the conditions of the datum
  std::string unused;      ///< legs that are not used because of backlash: note_on_unused()
};

/// Rank of the data that the legs give: points 8.3 mm apart, without those near the ends of a leg
/// (Options::corner_m), two directions across the leg. Legs are evaluated in groups and no further
/// than necessary. The path is one that check(Path, MachineNodes) accepts; BadInput for a machine
/// without a layout; RankDeficient if an axis does not move and backlash is estimated.
[[nodiscard]] Result<Observability> observability(
    const Path&, const Machine&, TravelDependence backlash = TravelDependence::None);

/// RankDeficient if the path leaves errors undetermined. The text names them, the parts of the
/// travel that the path does not reach, and the legs that are not used because of backlash.
[[nodiscard]] Result<void> check_observable(const Path&, const Machine&,
                                            TravelDependence backlash = TravelDependence::None);

}  // namespace abbe::calib::otf
