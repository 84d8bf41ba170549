#pragma once
/// Assignment of the visits to positions; it contains nests that moved and visits that are wrong.

#include <string>
#include <vector>

#include "nests/drift_likelihood.hpp"

namespace abbe::calib::otf {

struct PlacesFound {
  NestPlaces place;
  LikelihoodGrid grid;  ///< likelihoods for these places
};
/// Finds the assignment: one place for each nest, and more for a nest that moved. A visit that is
/// alone at its place is not used. NotConverged if `stopped` returns true.
[[nodiscard]] Result<PlacesFound> find_places(const DriftLikelihood&, const Stopped& stopped);

/// Number of visits at places that were visited at least twice.
[[nodiscard]] std::size_t visits_used(const NestPlaces&);

/// One note for each visit that is not used, and for each visit after which a nest is at another
/// place. `at_m`: positions of the places, relative to the first visit of the nest.
[[nodiscard]] std::vector<std::string> notes_on_places(const DriftObservations&, const NestPlaces&,
                                                       const std::vector<Vector3>& at_m);

}  // namespace abbe::calib::otf
