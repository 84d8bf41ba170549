#pragma once
/// Nests that were moved, and visits that are wrong: the positions to which visits belong.

#include <string>
#include <vector>

#include "nests/drift_likelihood.hpp"

namespace abbe::calib::otf {

struct PlacesFound {
  NestPlaces place;
  LikelihoodGrid grid;  ///< for these places
};
/// One position for each nest, and more for a nest that moved. A visit with a position of its own
/// is not used. NotConverged if `stopped` returns true.
[[nodiscard]] Result<PlacesFound> find_places(const DriftLikelihood&, const Stopped& stopped);

/// Visits of a place that was visited at least twice.
[[nodiscard]] std::size_t visits_used(const NestPlaces&);

/// One note for each visit that is not used, and for each visit after which a nest is elsewhere.
/// `at_m`: positions of the places, relative to the first visit of the nest.
[[nodiscard]] std::vector<std::string> notes_on_places(const DriftObservations&, const NestPlaces&,
                                                       const std::vector<Vector3>& at_m);

}  // namespace abbe::calib::otf
